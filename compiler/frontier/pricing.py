"""What a placement costs once it is trained on all rows: its tables, how long they take to read and to classify."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.tables import IntegerTables, tables_to_bytes

from ..evaluation.folds import Fold
from ..samples import Columns
from ..tables.collapse import collapse
from ..tables.quantise import quantise
from .equipment import Equipment
from .learnt import trained
from .material import Material
from .settings import Shape
from .timing.classify_times import Classified
from .timing.scan_times import ScanTimes, scan_times

# Of more rows than this, evenly spaced ones tell how early a scan ends.
_FRAMES = 1000


class Tabled(Struct, frozen=True):
    """Which tables: of the ensemble after so many rounds, cut in this shape."""

    rounds: int
    shape: Shape


class PriceKey(Struct, frozen=True):
    """Which prices: of tables on these switches and perhaps the joints, built of this equipment; on the test rows of
    which fold scans are timed, "" for all rows.
    """

    columns: Columns
    joints: bool
    tables: tuple[Tabled, ...]
    max_bins: int | None
    equipment: tuple[str, ...]
    fold: str = ""


class Wired(Struct, frozen=True):
    """What reading the switches takes in one wiring, "as wired" or of a new glove, at this clock."""

    wiring: str
    clock_hz: int
    scan: ScanTimes


class PricedTables(Struct, frozen=True):
    """Tables with what they cost: `content` is a tables.bin; `wired` is empty where no switch is read; `seconds` is how
    long it took to train for as many rounds and to make these tables.
    """

    tabled: Tabled
    content: bytes
    classified: tuple[Classified, ...]
    wired: tuple[Wired, ...]
    seconds: float


class Priced(Struct, frozen=True):
    """The prices of all tables that were asked for."""

    tables: tuple[PricedTables, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PriceTask:
    """Train on all rows and see what the tables cost.

    fold  how early scans end is seen on its test rows, by tables of its training rows, as rows that were trained on end
          them too soon; None: on all rows, where nobody asks about scans that end early
    """

    key: PriceKey
    material: Material
    equipment: Equipment
    cost: float
    fold: Fold | None = None


def find_prices(task: PriceTask) -> Priced:
    """Return what `task` asks for."""
    material, key, fold = task.material, task.key, task.fold
    made = list(_made(material, key, np.arange(len(material.labels))))
    scanned = made if fold is None else list(_made(material, key, fold.train))
    rows = np.arange(len(material.labels)) if fold is None else fold.test
    frames = _spread(material.inputs(key.columns, key.joints)[rows])
    return Priced(
        tuple(
            PricedTables(
                one.tabled,
                tables_to_bytes(one.tables),
                task.equipment.model.options(one.tables),
                _wired(task, held.tables, frames),
                one.seconds,
            )
            for one, held in zip(made, scanned, strict=True)
        )
    )


def tables_of(material: Material, key: PriceKey, rows: NDArray[np.intp]) -> dict[Tabled, IntegerTables]:
    """Return the tables that `key` asks for, trained on these rows."""
    return {made.tabled: made.tables for made in _made(material, key, rows)}


@dataclass(frozen=True, slots=True)
class _Made:
    tabled: Tabled
    tables: IntegerTables
    seconds: float


def _made(material: Material, key: PriceKey, rows: NDArray[np.intp]) -> Iterator[_Made]:
    began = time.perf_counter()
    X, kept, most = material.inputs(key.columns, key.joints), len(key.columns), max(one.rounds for one in key.tables)
    stumps = trained(material, X, rows, most, key.max_bins)
    training_s = time.perf_counter() - began
    bits, codes = X[rows, :kept].astype(bool), X[rows, kept:]
    for tabled in key.tables:
        began = time.perf_counter()
        scores = collapse(stumps.first(tabled.rounds), kept)
        tables = quantise(scores, bits, codes, tabled.shape.width, tabled.shape.table_bits)
        yield _Made(tabled, tables, training_s * tabled.rounds / most + time.perf_counter() - began)


def _spread(frames: NDArray[np.uint16]) -> NDArray[np.uint16]:
    return frames[np.linspace(0, len(frames) - 1, min(_FRAMES, len(frames))).astype(np.intp)]


def _wired(task: PriceTask, tables: IntegerTables, frames: NDArray[np.uint16]) -> tuple[Wired, ...]:
    columns, equipment = task.key.columns, task.equipment
    names = [task.material.switch_names[column] for column in columns]
    bits, codes = frames[:, : len(columns)].astype(bool), frames[:, len(columns) :]
    return tuple(
        Wired(wiring.name, wiring.clock_hz, scan_times(names, tables, wiring, bits, codes, equipment.beside))
        for wiring in equipment.fitting(names)
    )
