"""The price of tables: the time of classifying a frame with them, their size, and the scans of their switches.

Times are predicted without compiling; on a front they are simulated, or measured in Python on this machine. Nothing
that is deployed depends on the machine's name.
"""

import platform
import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.model.integers import IntegerTables, tables_from_bytes, tables_to_bytes
from thenar.runtime.recipe import Recipe
from thenar.runtime.scores import Scorer

from ..evaluation.folds import Rows
from ..firmware import FirmwareError
from ..firmware.classifier import LIBRARY_NAME, Library
from ..firmware.costs import PartFit, fit_for, run_counted
from ..firmware.probes import random_frames
from ..firmware.targets import TARGETS, Target, timed
from ..firmware.words import numbered
from ..placement.placement import InputSelection
from ..recogniser import Recogniser
from ..recordings.graspset import GraspSet
from ..samples import Samples
from ..trainers.base import Training
from .cache import Cache, stored
from .points import FrontierError, How
from .wirings import (
    NO_RECORDS,
    ReadingCost,
    ScanTimes,
    WiringOption,
    is_avr,
    overhead_of,
    records_of,
    scan_times,
    wirings,
)

# Python's time on a Raspberry Pi 4 relative to here: a guess, and "here" is any machine.
PI_FACTOR = 4.0
MODEL_FILE, PROCESSOR_FILE = Path("/proc/device-tree/model"), Path("/proc/cpuinfo")

# Shapes that are timed: switches, joints, grasp types.
_SWITCHES, _JOINTS, _CLASSES = (0, 1, 4, 8, 16, 33, 66, 160), (0, 16, 22), (4, 14, 33)
YARDSTICK = (33, 16, 14)
_BINS, _REACH, _HIGHEST = 8, 60, 254
_FRAMES, _PASSES = 20, 20

# Microseconds a frame: a constant, and per switch, joint, class, (switch, class) and (joint, class); then the time of
# tables of the shape YARDSTICK during the fit, which is the machine's speed.
PythonCost = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Classified:
    """The costs of tables: microseconds a frame, bytes of flash and RAM; of the tables alone on host and pi."""

    us: float
    how: How
    flash: int
    ram: int


class ClassifyModel:
    """Predicts the time of classifying on `target`, one of `timed()`.

    AVR       cycles of classify() for the slowest frame, by the target's formula, at its clock
    Cortex-M  instructions of classify(), likewise, at its clock and one cycle each: hardly any such core is faster,
              and loads, taken branches and slow flash take more cycles, so times are lower bounds
    host      wall time of the runtime's Scorer here, by a linear fit to tables that are timed on construction
    pi        that times PI_FACTOR; the same time if this machine is a Raspberry Pi

    python is the result of `fit_here`, for reuse. Raises FrontierError for another target.
    """

    def __init__(self, target: str, *, python: PythonCost | None = None) -> None:
        if target not in timed():
            raise FrontierError(f"there is no target {target!r}: choose one of {', '.join(timed())}")
        part = TARGETS.get(target)
        self.target = target
        self.clock_hz = None if part is None else part.clock_hz
        self.part: Target | None = None if self.clock_hz is None else part
        self.python = (python or fit_here()) if self.part is None else None
        self.factor = PI_FACTOR if target == "pi" and not on_a_pi() else 1.0

    @property
    def identity(self) -> tuple[object, ...]:
        """Everything that its predictions depend on, in addition to the tables."""
        return self.target, self.clock_hz, self.python, self.factor

    def cost(self, tables: IntegerTables) -> Classified | None:
        """Return the cost of tables; None where they do not fit."""
        if self.python is not None:
            *weights, _ = self.python
            us = float(_features(tables.n_switches, tables.n_joints, tables.n_classes) @ np.array(weights))
            size = len(tables_to_bytes(tables))
            how: How = "guess" if self.guessed else "model"
            return Classified(us * self.factor, how, size, size)
        assert self.part is not None
        fit = fitting(tables, self.part)
        if fit is None or fit.cost is None:
            return None
        return Classified(self.us(fit.cost.cycles), "model", fit.cost.flash, fit.cost.ram)

    def us(self, steps: int) -> float:
        """Return the microseconds of `steps` cycles or instructions of the part."""
        assert self.clock_hz is not None
        return steps * 1e6 / self.clock_hz

    @property
    def guessed(self) -> bool:
        """Whether its times are guesses: of a Raspberry Pi, on another machine."""
        return self.factor != 1.0

    @property
    def machine(self) -> str:
        """The machine that its times are of."""
        if self.part is not None and self.clock_hz is not None:
            return f"{self.part.named} at {self.clock_hz / 1e6:g} MHz"
        guess = f"Raspberry Pi, a guess: {self.factor:g} times "
        return f"{guess if self.guessed else ''}{machine_name()}"

    @property
    def note(self) -> str:
        """The caveat on its times, in a sentence; "" if there is none."""
        if self.part is not None and not self.part.avr and self.clock_hz is not None:
            return (
                f"on {self.target} times are instructions, estimated, at {self.clock_hz / 1e6:g} MHz and one "
                "cycle each: a lower bound, for many instructions take more cycles"
            )
        if self.python is not None and not self.guessed:
            return "times of classifying in Python leave out the check for unusual frames, which most builds make"
        if self.guessed:
            return (
                f"Python on a Raspberry Pi is taken to be {self.factor:g} times as slow as on this machine, which is a "
                "guess: run thenar frontier --target pi on the Pi itself"
            )
        return ""

    @property
    def unmeasured(self) -> str:
        """Why its times cannot be measured here, in a sentence; "" if they can."""
        if self.guessed:
            return "classify times on pi were not measured: this machine is no Raspberry Pi"
        lack = self.part.missing() if self.part is not None else None
        return f"classify times on {self.target} were not counted in a simulator: {lack}" if lack else ""


def fitting(tables: IntegerTables, part: Target) -> PartFit | None:
    """Return the fit of `tables` on a part, with its cost; None where they do not fit."""
    try:
        return fit_for(part, tables)
    except FirmwareError:
        return None


@stored(1, here=True)
def fit_here() -> PythonCost:
    """Time tables of many shapes on this machine and fit them by least relative squares, no weight below 0.

    Takes about a second, and differs from one run to the next with the machine's speed.
    """
    from scipy.optimize import nnls

    shapes = [shape for shape in product(_SWITCHES, _JOINTS, _CLASSES) if shape[0] + shape[1]]
    taken = np.array(classify_us([random_tables(*shape) for shape in shapes]))
    rows = np.array([_features(*shape) for shape in shapes])
    weights, _ = nnls(rows / taken[:, np.newaxis], np.ones(len(taken)))
    return (*weights.tolist(), float(taken[shapes.index(YARDSTICK)]))


def classify_us(several: Sequence[IntegerTables], yardstick: float | None = None) -> list[float]:
    """Return the time of classifying a frame here with each of the tables, as `Build.classify` does it, but without the
    check for unusual frames: the mean over random frames.

    yardstick  microseconds of tables of the shape YARDSTICK at the reference speed; None: at the current speed

    For every frame the least of several passes over all tables counts: other work on the machine only adds time, and a
    busy moment affects all of them. But clocks, and neighbours of a virtual machine, change its speed for minutes, by
    half and more: so the yardstick is timed in the same passes.
    """
    probed = []
    for tables in (*several, random_tables(*YARDSTICK)):
        probes = random_frames(tables, _FRAMES, seed=1)
        probed.append((Scorer(tables), list(zip(probes.bits, probes.codes, strict=True))))
    least_s = np.full((len(probed), _FRAMES), np.inf)
    for _ in range(_PASSES):
        for (scorer, frames), least in zip(probed, least_s, strict=True):
            for number, (bits, codes) in enumerate(frames):
                start = time.perf_counter()
                biased_scores = scorer.biased_scores(bits, codes)
                biased_scores.index(max(biased_scores))
                least[number] = min(least[number], time.perf_counter() - start)
    *found, now = (1e6 * least_s.sum(axis=1) / _FRAMES).tolist()
    return [us if yardstick is None else us * yardstick / now for us in found]


def _features(switches: int, joints: int, classes: int) -> NDArray[np.float64]:
    return np.array([1, switches, joints, classes, switches * classes, joints * classes], float)


def random_tables(switches: int, joints: int, classes: int) -> IntegerTables:
    """Return tables of that shape, always the same, with 8 rows a joint: their values do not affect the time."""
    random = np.random.default_rng(switches + 1000 * joints)

    def rows(*shape: int) -> NDArray[np.int16]:
        return random.integers(-_REACH, _REACH, (*shape, classes), np.int16, endpoint=True)

    return IntegerTables.of(
        bias=rows(),
        switch_rows=rows(switches),
        thresholds=tuple(
            np.sort(random.choice(_HIGHEST, _BINS - 1, replace=False)).astype(np.uint16) for _ in range(joints)
        ),
        joint_rows=tuple(rows(_BINS) for _ in range(joints)),
        switch_means=rows(switches),
        joint_means=rows(joints),
        scale=100.0,
    )


def on_a_pi() -> bool:
    """Return whether this machine is a Raspberry Pi."""
    return "Raspberry Pi" in _text(MODEL_FILE)


def machine_name() -> str:
    """Return this machine's board or processor, and its Python: "AMD EPYC, Python 3.11"."""
    listed = re.search(r"^model name\s*:\s*(.+)$", _text(PROCESSOR_FILE), re.MULTILINE)
    board = _text(MODEL_FILE).replace("\0", "")
    name = board or (listed[1] if listed else "") or platform.processor() or platform.machine()
    plain = " ".join(re.sub(r"\((?:R|TM)\)|\bCPU\b|@.*", " ", name).split())
    return f"{plain}, Python {'.'.join(platform.python_version_tuple()[:2])}"


def _text(file: Path) -> str:
    try:
        return file.read_text(errors="replace")
    except OSError:
        return ""


@dataclass(frozen=True, slots=True, eq=False)
class Equipment:
    """The target's model, the candidate wirings, the overhead of a transaction, and the time of a record."""

    model: ClassifyModel
    wirings: tuple[WiringOption, ...]
    overhead: ReadingCost
    records: ReadingCost = NO_RECORDS

    def scans(self, names: Sequence[str]) -> tuple[ScanTimes, ...]:
        """Return the scan of these switches in each wiring that has a place for all; none if there are no switches."""
        wirings = [wiring for wiring in self.wirings if wiring.fits(names)] if names else []
        return tuple(scan_times(names, wiring, self.overhead) for wiring in wirings)


def equipment_for(
    grasp_set: GraspSet, harness: Harness | None, target: str, cache: Cache, joint_us: float | None = None
) -> Equipment:
    """Return the hardware options for `target` and the inputs of a set: those of the harness, and of a new glove.

    joint_us  time of reading all joints, None if unknown

    Where the target classifies in Python, that is timed here once.
    """
    glove = None if harness is None else harness.cyberglove
    records = records_of(grasp_set.joint_names, joint_us, glove, masked=not is_avr(target))
    switches, taxels = bool(grasp_set.switch_names), bool(grasp_set.taxel_columns)
    options = wirings(harness, target, switches=switches or not taxels, taxels=taxels)
    in_python = target not in TARGETS or TARGETS[target].clock_hz is None
    costs = cache.ask(fit_here, [()] if in_python else [])
    return Equipment(ClassifyModel(target, python=costs[0] if costs else None), options, overhead_of(target), records)


class PricedTables(Struct, frozen=True):
    """The tables of a recipe with their costs: `content` is a tables.bin, None does not fit the target; `scans` is
    empty if no switch is read.
    """

    recipe: Recipe
    content: bytes
    classified: Classified | None
    scans: tuple[ScanTimes, ...]

    def fastest_us(self, joints_us: float) -> float | None:
        """Return the least frame time in any wiring; None if nothing fits the target."""
        if self.classified is None:
            return None
        scan_us = min((scan.us for scan in self.scans), default=0.0)
        return max(scan_us, joints_us) + self.classified.us


@stored(8)
def price(
    samples: Samples,
    names: tuple[str, ...],
    rows: Rows,
    selection: InputSelection,
    recipes: tuple[Recipe, ...],
    training: Training,
    equipment: Equipment,
    lost: bool,
) -> tuple[PricedTables, ...]:
    """Train on some rows, on the selected inputs, whose elements have these names; price the tables.

    lost  fit the substitutes for lost inputs, which firmware stores
    """
    scans = equipment.scans(names)
    return tuple(
        PricedTables(recipe, tables_to_bytes(made), equipment.model.cost(made), scans)
        for recipe, made in tables_of(samples, rows, selection, recipes, training, lost=lost)
    )


def tables_of(
    samples: Samples,
    rows: Rows,
    selection: InputSelection,
    recipes: Sequence[Recipe],
    training: Training,
    *,
    lost: bool = False,
) -> Iterator[tuple[Recipe, IntegerTables]]:
    """Yield the tables of each recipe, which differ in rounds and shape, from one training on some rows.

    lost  fit the substitutes for lost inputs, as in a build, for firmware. Otherwise they are mean rows
    """
    rounds = [one.rounds or 1 for one in recipes]
    made = Recogniser.stages(samples, recipes[0], rows, selection, training, rounds)
    for recipe, recogniser in zip(recipes, made, strict=True):
        shaped = replace(recogniser, recipe=recipe)
        yield recipe, shaped.tables if lost else shaped.integers


@stored(4)
def count_steps(content: bytes, model: ClassifyModel) -> float:
    """Compile the classifier of tables and run it; return the cycles of the slowest of the frames that should take
    longest and of extreme ones. Raises FirmwareError.
    """
    assert model.part is not None
    fit = fitting(tables_from_bytes(content), model.part)
    assert fit is not None
    library = Library(LIBRARY_NAME, numbered(fit.layout.tables), fit.layout)
    return float(run_counted(library, fit.target).most)


@stored(2, here=True)
def time_here(contents: tuple[bytes, ...], yardstick: float) -> tuple[float, ...]:
    """Time the runtime on each of the tables, scaled by its yardstick; return microseconds."""
    return tuple(classify_us([tables_from_bytes(content) for content in contents], yardstick))
