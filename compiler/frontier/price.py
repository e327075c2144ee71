"""The price of a placement trained on all rows: its tables, and the times of reading and classifying."""

import time
from collections.abc import Iterator

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.tables import IntegerTables, tables_to_bytes

from ..evaluation.folds import Fold, Rows
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

# Of more rows than this, evenly spaced ones determine how early a scan ends.
_FRAMES = 1000


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
    classified: tuple[Classified, ...]
    wired: tuple[Wired, ...]
    seconds: float

    def fastest_us(self, joints_us: float) -> float | None:
        """Return the least frame time in any wiring, whole scans; None if nothing fits the target."""
        if not self.classified:
            return None
        scan_us = min((wired.scan.full_us for wired in self.wired), default=0.0)
        return max(scan_us, joints_us) + self.classified[0].us


@stored(3)
def price(
    samples: Samples,
    names: tuple[str, ...],
    columns: Columns,
    tables: tuple[Tabled, ...],
    training: Training,
    equipment: Equipment,
    held: tuple[Fold, Training] | None,
) -> tuple[PricedTables, ...]:
    """Train on all rows, on the switches `columns`, which have these names, and the joints; price the tables.

    held  measures early ends of scans on the test rows of a fold, by tables of its training rows, since training rows
          end scans too soon; None: on all rows, with mean rows for lost inputs, which is enough if early ends and
          exact flash sizes do not matter
    """
    rows = np.arange(len(samples.labels))
    made = list(tables_of(samples, rows, columns, tables, training, lost=held is not None))
    scanned = made if held is None else list(tables_of(samples, held[0].train, columns, tables, held[1], lost=True))
    tested = rows if held is None else held[0].test
    spread = tested[np.linspace(0, len(tested) - 1, min(_FRAMES, len(tested))).astype(np.intp)]
    frames = samples.kept(columns)[spread]
    return tuple(
        PricedTables(
            tabled,
            tables_to_bytes(whole),
            equipment.model.options(whole),
            _wired(names, held, frames, equipment),
            seconds,
        )
        for (tabled, whole, seconds), (_, held, _) in zip(made, scanned, strict=True)
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

    lost  fit the substitutes for lost inputs, as in a build: early ends of scans, and the flash size, depend on them,
          while scores of whole frames do not. Otherwise they are mean rows
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


def _wired(
    names: tuple[str, ...], tables: IntegerTables, frames: NDArray[np.uint16], equipment: Equipment
) -> tuple[Wired, ...]:
    bits, codes = frames[:, : len(names)].astype(bool), frames[:, len(names) :]
    return tuple(
        Wired(wiring.name, wiring.clock_hz, scan_times(names, tables, wiring, bits, codes, equipment.overhead))
        for wiring in equipment.fitting(names)
    )
