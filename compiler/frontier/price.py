"""The price of a placement trained on all rows, with the hardware of a glove: the times of reading and classifying."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from msgspec import Struct

from thenar.runtime.model.integers import IntegerTables, tables_from_bytes, tables_to_bytes
from thenar.runtime.recipe import Recipe

from ..evaluation.folds import Rows
from ..firmware.choose import PartFit
from ..firmware.classifier import LIBRARY_NAME, Library
from ..firmware.measuring import run_counted, slow_frames
from ..firmware.words import numbered
from ..placement.placement import InputSelection
from ..recogniser import Recogniser
from ..samples import Samples
from ..trainers.base import Training
from .cache import Cache, stored
from .points import PointTime
from .timing.classify_times import Classified, ClassifyModel, PythonCost, classify_us, fitting
from .timing.scan_times import NO_RECORDS, ReadingCost, ScanTimes, overhead_of, scan_times
from .timing.wirings import WiringOption


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


@stored(2, here=True)
def calibrate(target: str) -> tuple[PythonCost | None, ReadingCost]:
    """Measure here, if the target requires it, the time of classifying in Python and the overhead of a transaction."""
    return ClassifyModel(target).python, overhead_of(target)


def equipment_for(
    target: str, wirings: tuple[WiringOption, ...], cache: Cache, records: ReadingCost = NO_RECORDS
) -> Equipment:
    """Return the hardware options for `target`, measured here once."""
    ((python, overhead),) = cache.ask(calibrate, [(target,)])
    return Equipment(ClassifyModel(target, python=python), wirings, overhead, records)


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


@stored(6)
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

    lost  fit the substitutes for lost inputs, which is needed if exact flash sizes matter
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

    lost  fit the substitutes for lost inputs, as in a build: the flash size depends on them, while scores of whole
          frames do not. Otherwise they are mean rows
    """
    rounds = [one.rounds or 1 for one in recipes]
    made = Recogniser.stages(samples, recipes[0], rows, selection, training, rounds)
    for recipe, recogniser in zip(recipes, made, strict=True):
        shaped = replace(recogniser, recipe=recipe)
        yield recipe, shaped.tables if lost else shaped.integers


@stored(3)
def count_steps(content: bytes, model: ClassifyModel) -> float:
    """Compile the classifier of tables and run it; return the cycles of the slowest frame.

    Raises FirmwareError.
    """
    assert model.part is not None
    fit = fitting(tables_from_bytes(content), model.part)
    assert fit is not None
    return steps_of(fit)


def steps_of(fit: PartFit) -> float:
    """Compile a classifier for its part and run it; return the cycles of the slowest of the frames that should take
    longest and of extreme ones. Raises FirmwareError.
    """
    library = Library(LIBRARY_NAME, numbered(fit.layout.tables), fit.layout)
    return float(run_counted(library, fit.target, slow_frames(library)).most)


@stored(2, here=True)
def time_here(contents: tuple[bytes, ...], yardstick: float) -> tuple[float, ...]:
    """Time the runtime on each of the tables, scaled by its yardstick; return microseconds."""
    return tuple(classify_us([tables_from_bytes(content) for content in contents], yardstick))


def measured(contents: Sequence[bytes], model: ClassifyModel, cache: Cache) -> dict[bytes, PointTime]:
    """Return the time of classifying with each of these tables, simulated or measured; none if that is not possible."""
    several = tuple(dict.fromkeys(contents))
    if model.unmeasured:
        return {}
    if model.python is None:
        steps = cache.ask(count_steps, [(content, model) for content in several])
        times = [PointTime(model.us(round(each)), "simulated") for each in steps]
    else:
        (us,) = cache.ask(time_here, [(several, model.python[-1])])
        times = [PointTime(each, "measured") for each in us]
    return dict(zip(several, times, strict=True))
