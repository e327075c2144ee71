"""The price of a placement trained on all rows: its tables, and the times of reading and classifying."""

import time
from collections.abc import Iterator

import numpy as np
from msgspec import Struct

from thenar.runtime.tables import IntegerTables, tables_to_bytes

from ..evaluation.folds import Rows
from ..samples import Columns, Samples
from ..tables.collapse import collapse
from ..tables.quantise import quantise
from ..tables.standing_in import fit_lost
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
    columns: Columns,
    tables: tuple[Tabled, ...],
    training: Training,
    equipment: Equipment,
    lost: bool,
) -> tuple[PricedTables, ...]:
    """Train on all rows, on the switches `columns`, which have these names, and the joints; price the tables.

    lost  fit the substitutes for lost inputs, which is needed if exact flash sizes matter
    """
    rows = np.arange(len(samples.labels))
    wired = tuple(
        Wired(wiring.name, wiring.clock_hz, scan_times(names, wiring, equipment.overhead))
        for wiring in equipment.fitting(names)
    )
    return tuple(
        PricedTables(tabled, tables_to_bytes(made), equipment.model.cost(made), wired, seconds)
        for tabled, made, seconds in tables_of(samples, rows, columns, tables, training, lost=lost)
    )


def tables_of(
    samples: Samples,
    rows: Rows,
    columns: Columns,
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
    kept = samples.rows(rows).keeping(columns)
    models = training.stages(kept, [one.rounds for one in tables])
    training_s = time.perf_counter() - began
    for tabled, model in zip(tables, models, strict=True):
        began = time.perf_counter()
        scores = collapse(model, kept.n_switches)
        made = quantise(scores, kept.switches, kept.codes, tabled.shape.width, tabled.shape.table_bits)
        made = fit_lost(made, kept.switches, kept.codes, kept.labels) if lost else made
        yield tabled, made, training_s * tabled.rounds / most + time.perf_counter() - began
