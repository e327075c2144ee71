"""What the points themselves take: every design on a front compiled and simulated, and the model beside it."""

from collections.abc import Sequence
from dataclasses import dataclass

from msgspec import Struct

from ...runtime.tables import IntegerTables, tables_from_bytes
from ..firmware.choose import Option, features
from ..firmware.targets import Target
from .asking import Desk
from .building import Design
from .checks import check, unchecked
from .classify_times import ClassifyModel, fitting
from .equipment import Equipment
from .measured_cycles import Trial, run_trial
from .points import Check, FrontierError, Time
from .wire_check import check_wire

_TRIAL_S = 2.0


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


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Classify times as they were simulated, by tables and layout; checks of the model; what could not be done."""

    times: dict[TrialKey, Time]
    target: str
    checks: tuple[Check, ...]
    skipped: tuple[str, ...]

    def classify(self, design: Design) -> Time:
        """Return what classifying takes: as simulated where it was, else as the model has it."""
        simulated = self.times.get(_key(design, self.target))
        if simulated is None:
            return design.classify
        return Time(simulated.us * design.looks, simulated.how)


def count_steps(task: CountTask) -> Counted:
    """Return what `task` asks for. Raises FirmwareError."""
    option = _option(tables_from_bytes(task.key.content), task.key.layout, task.part)
    return Counted(run_trial(Trial(option, task.part)).counted)


def measure_designs(equipment: Equipment, designs: Sequence[Design], desk: Desk) -> Measured:
    """Return what the designs take, and how far the model is off over these and more."""
    model = equipment.model
    lack = unchecked(model)
    times = {} if model.part is None or lack else _simulated(model, model.part, designs, desk)
    tables = [tables_from_bytes(content) for content in dict.fromkeys(design.tables.content for design in designs)]
    checks = check(model, tables, jobs=desk.jobs)
    wire, without = check_wire()
    said = (lack, model.note, equipment.beside.what, without)
    return Measured(times, model.target, (*checks, *wire), tuple(sentence for sentence in said if sentence))


def _simulated(model: ClassifyModel, part: Target, designs: Sequence[Design], desk: Desk) -> dict[TrialKey, Time]:
    tasks = [CountTask(_key(design, model.target), part, _TRIAL_S) for design in designs]
    found = desk.ask("simulations", tasks, count_steps, Counted)
    return {task.key: Time(model.us(round(found[task.key].steps)), "simulated") for task in tasks}


def _key(design: Design, target: str) -> TrialKey:
    return TrialKey(design.tables.content, design.classified.layout, target)


def _option(tables: IntegerTables, layout: str, part: Target) -> Option:
    for option in fitting(tables, part):
        if features(option[0], part) == layout:
            return option
    raise FrontierError(f"there is no layout {layout!r} of these tables: another thenar made the store")
