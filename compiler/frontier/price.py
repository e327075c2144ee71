"""The price of a placement trained on all rows: its tables, and the times of reading and classifying."""

import time
from collections.abc import Iterator
from dataclasses import replace

from msgspec import Struct

from thenar.runtime.recipe import Recipe
from thenar.runtime.tables import IntegerTables, tables_to_bytes

from ..evaluation.folds import Rows
from ..placement.placement import InputSelection
from ..recogniser import Recogniser
from ..samples import Samples
from ..trainers.base import Training
from .cache import stored
from .equipment import Equipment
from .search import Shape
from .timing.classify_times import Classified
from .timing.scan_times import ScanTimes, scan_times


class Tabled(Struct, frozen=True):
    """Which tables: of the ensemble after `rounds` rounds, cut in this shape."""

    rounds: int
    shape: Shape


class Wired(Struct, frozen=True):
    """Time of reading the switches in one wiring, "as wired" or of a new glove, at this clock."""

    wiring: str
    clock_hz: int
    scan: ScanTimes


class PricedTables(Struct, frozen=True):
    """Tables with their costs: `content` is a tables.bin; `wired` is empty if no switch is read; `seconds` is the time
    of training to this round and making these tables.
    """

    tabled: Tabled
    content: bytes
    classified: Classified | None
    wired: tuple[Wired, ...]
    seconds: float

    def fastest_us(self, joints_us: float) -> float | None:
        """Return the least frame time in any wiring; None if nothing fits the target."""
        if self.classified is None:
            return None
        scan_us = min((wired.scan.us for wired in self.wired), default=0.0)
        return max(scan_us, joints_us) + self.classified.us


@stored(5)
def price(
    samples: Samples,
    names: tuple[str, ...],
    rows: Rows,
    selection: InputSelection,
    tables: tuple[Tabled, ...],
    training: Training,
    equipment: Equipment,
    lost: bool,
) -> tuple[PricedTables, ...]:
    """Train on some rows, on the selected inputs, whose elements have these names; price the tables.

    lost  fit the substitutes for lost inputs, which is needed if exact flash sizes matter
    """
    wired = tuple(
        Wired(wiring.name, wiring.clock_hz, scan_times(names, wiring, equipment.overhead))
        for wiring in equipment.fitting(names)
    )
    return tuple(
        PricedTables(tabled, tables_to_bytes(made), equipment.model.cost(made), wired, seconds)
        for tabled, made, seconds in tables_of(samples, rows, selection, tables, training, lost=lost)
    )


def tables_of(
    samples: Samples,
    rows: Rows,
    selection: InputSelection,
    tables: tuple[Tabled, ...],
    training: Training,
    *,
    lost: bool = False,
) -> Iterator[tuple[Tabled, IntegerTables, float]]:
    """Yield the requested tables of one training on some rows, with the seconds that each took.

    lost  fit the substitutes for lost inputs, as in a build: the flash size depends on them, while scores of whole
          frames do not. Otherwise they are mean rows
    """
    began, most = time.perf_counter(), max(one.rounds for one in tables)
    made = Recogniser.stages(samples, Recipe(), rows, selection, training, [one.rounds for one in tables])
    training_s = time.perf_counter() - began
    for tabled, recogniser in zip(tables, made, strict=True):
        began = time.perf_counter()
        shaped = replace(recogniser, recipe=tabled.shape.recipe)
        integers = shaped.tables if lost else shaped.integers
        yield tabled, integers, training_s * tabled.rounds / most + time.perf_counter() - began
