"""What the points themselves take: every design on a front simulated, or timed here, and the model beside it."""

import platform
from collections.abc import Sequence
from dataclasses import dataclass, replace

from msgspec import Struct

from thenar.runtime.tables import IntegerTables, tables_from_bytes

from ..firmware.choose import Option, features
from ..firmware.targets import Target
from .designs import Design
from .equipment import Equipment
from .points import Check, FrontierError, Time
from .storing.asking import Desk
from .timing.checks import LEAST, check, unchecked
from .timing.classify_times import ClassifyModel, fitting
from .timing.measured_cycles import Trial, run_trial
from .timing.python_times import classify_us
from .timing.wire_check import check_wire

# Expected seconds: of a trial, of checks in Python.
TRIAL_S, CHECK_S = 2.0, 5.0


class TrialKey(Struct, frozen=True):
    """Which trial: these tables in this layout on this target."""

    content: bytes
    layout: str
    target: str


class Counted(Struct, frozen=True):
    """Cycles, or instructions, that the slowest frame took."""

    steps: float


@dataclass(frozen=True, slots=True, eq=False)
class CountTask:
    """Compile a layout and run it."""

    key: TrialKey
    part: Target
    cost: float


class TimeKey(Struct, frozen=True):
    """Which wall times: of the runtime with these tables, on a machine, at the pace that its yardstick says."""

    contents: tuple[bytes, ...]
    machine: str
    yardstick: float


class Timed(Struct, frozen=True):
    """Microseconds a frame, of each of the tables."""

    us: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class TimeTask:
    """Let the runtime classify on this machine."""

    key: TimeKey
    cost: float = 1.0


class CheckKey(Struct, frozen=True):
    """Which checks: of the model of this equipment, over these tables."""

    contents: tuple[bytes, ...]
    equipment: tuple[str, ...]


class Checked(Struct, frozen=True):
    """How far the model is off."""

    checks: tuple[Check, ...]


@dataclass(frozen=True, slots=True, eq=False)
class CheckTask:
    """Hold a model against what is measured, in `jobs` processes."""

    key: CheckKey
    model: ClassifyModel
    jobs: int
    cost: float


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Classify times as simulated or timed, by tables and layout; checks of the model; what could not be done."""

    times: dict[TrialKey, Time]
    target: str
    checks: tuple[Check, ...]
    skipped: tuple[str, ...]

    def classify(self, design: Design) -> Time:
        """Return what classifying takes: as simulated or timed where it was, else as the model has it."""
        known = self.times.get(_key(design, self.target))
        return design.classify if known is None else Time(known.us * design.looks, known.how)


def count_steps(task: CountTask) -> Counted:
    """Return what `task` asks for. Raises FirmwareError."""
    option = _option(tables_from_bytes(task.key.content), task.key.layout, task.part)
    return Counted(run_trial(Trial(option, task.part)).counted)


def measure_designs(equipment: Equipment, designs: Sequence[Design], desk: Desk) -> Measured:
    """Return what the designs take, and how far the model is off over these and more.

    The simulators of this machine are asked, whatever cluster there is: its workers may have none.
    """
    model, here = equipment.model, replace(desk, cluster=None)
    lack = unchecked(model)
    times = {} if lack else _simulated(model, model.part, designs, here) if model.part else _timed(designs, model, here)
    checks = () if lack else _checks(equipment, designs, here)
    wire, without = check_wire()
    said = (lack, model.note, equipment.beside.what, without)
    return Measured(times, model.target, (*checks, *wire), tuple(sentence for sentence in said if sentence))


def run_checks(task: CheckTask) -> Checked:
    """Return what `task` asks for. Raises FirmwareError."""
    return Checked(check(task.model, [tables_from_bytes(content) for content in task.key.contents], jobs=task.jobs))


def time_here(task: TimeTask) -> Timed:
    """Return what `task` asks for."""
    several = [tables_from_bytes(content) for content in task.key.contents]
    return Timed(tuple(classify_us(several, task.key.yardstick)))


def _timed(designs: Sequence[Design], model: ClassifyModel, desk: Desk) -> dict[TrialKey, Time]:
    assert model.python is not None
    contents = tuple(dict.fromkeys(design.tables.content for design in designs))
    task = TimeTask(TimeKey(contents, platform.node(), model.python.yardstick))
    us = dict(zip(contents, desk.here().ask("simulations", [task], time_here, Timed)[task.key].us, strict=True))
    return {_key(design, model.target): Time(us[design.tables.content], "measured") for design in designs}


def _simulated(model: ClassifyModel, part: Target, designs: Sequence[Design], desk: Desk) -> dict[TrialKey, Time]:
    tasks = [CountTask(_key(design, model.target), part, TRIAL_S) for design in designs]
    found = desk.ask("simulations", tasks, count_steps, Counted)
    return {task.key: Time(model.us(round(found[task.key].steps)), "simulated") for task in tasks}


def _checks(equipment: Equipment, designs: Sequence[Design], desk: Desk) -> tuple[Check, ...]:
    contents = tuple(dict.fromkeys(design.tables.content for design in designs))
    cost = CHECK_S if equipment.model.part is None else LEAST * TRIAL_S
    task = CheckTask(CheckKey(contents, equipment.identity), equipment.model, desk.jobs, cost)
    return desk.here().ask("checks", [task], run_checks, Checked)[task.key].checks


def _key(design: Design, target: str) -> TrialKey:
    return TrialKey(design.tables.content, design.classified.layout, target)


def _option(tables: IntegerTables, layout: str, part: Target) -> Option:
    for option in fitting(tables, part):
        if features(option[0], part) == layout:
            return option
    raise FrontierError(f"there is no layout {layout!r} of these tables: another thenar made the store")
