"""What a placement costs once it is trained on all rows: its tables, how long they take to read and to classify."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from ...runtime.tables import IntegerTables, tables_to_bytes
from ..selection.learning import Columns
from ..tables.collapse import collapse
from ..tables.quantise import quantise
from .classify_times import Classified
from .equipment import Equipment
from .learnt import trained
from .material import Material
from .scan_times import ScanTimes, scan_times
from .settings import Shape

# Of more rows than this, evenly spaced ones tell how early a scan ends.
_FRAMES = 1000


class Tabled(Struct, frozen=True):
    """Which tables: of the ensemble after so many rounds, cut in this shape."""

    rounds: int
    shape: Shape


class PriceKey(Struct, frozen=True):
    """Which prices: of tables on these switches and perhaps the joints, built of this equipment."""

    columns: Columns
    joints: bool
    tables: tuple[Tabled, ...]
    max_bins: int | None
    equipment: tuple[str, ...]


class Wired(Struct, frozen=True):
    """What reading the switches takes in one wiring, "as wired" or of a new glove, at this clock."""

    wiring: str
    clock_hz: int
    scan: ScanTimes


class PricedTables(Struct, frozen=True):
    """Tables with what they cost: `content` is a tables.bin; `wired` is empty where no switch is read."""

    tabled: Tabled
    content: bytes
    classified: tuple[Classified, ...]
    wired: tuple[Wired, ...]


class Priced(Struct, frozen=True):
    """The prices of all tables that were asked for, and how long training and tables took."""

    seconds: float
    tables: tuple[PricedTables, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PriceTask:
    """Train on all rows and see what the tables cost."""

    key: PriceKey
    material: Material
    equipment: Equipment
    cost: float


def find_prices(task: PriceTask) -> Priced:
    """Return what `task` asks for."""
    began = time.perf_counter()
    found = list(tables_of(task.material, task.key))
    seconds = time.perf_counter() - began
    return Priced(seconds, tuple(_priced(task, tabled, tables) for tabled, tables in found))


def tables_of(
    material: Material, key: PriceKey, rows: NDArray[np.intp] | None = None
) -> Iterator[tuple[Tabled, IntegerTables]]:
    """Yield the tables that `key` asks for, trained on these rows (all of them unless given)."""
    learnt = np.arange(len(material.labels)) if rows is None else rows
    X = material.inputs(key.columns, key.joints)
    stumps = trained(material, X, learnt, max(tabled.rounds for tabled in key.tables), key.max_bins)
    kept = len(key.columns)
    bits, codes = X[learnt, :kept].astype(bool), X[learnt, kept:]
    for tabled in key.tables:
        scores = collapse(stumps.first(tabled.rounds), kept)
        yield tabled, quantise(scores, bits, codes, tabled.shape.width, tabled.shape.table_bits)


def _priced(task: PriceTask, tabled: Tabled, tables: IntegerTables) -> PricedTables:
    material, columns, equipment = task.material, task.key.columns, task.equipment
    names = [material.switch_names[column] for column in columns]
    rows = np.linspace(0, len(material.labels) - 1, min(_FRAMES, len(material.labels))).astype(np.intp)
    frames = material.inputs(columns, task.key.joints)[rows]
    bits, codes = frames[:, : len(columns)].astype(bool), frames[:, len(columns) :]
    wired = tuple(
        Wired(wiring.name, wiring.clock_hz, scan_times(names, tables, wiring, bits, codes, equipment.beside))
        for wiring in equipment.fitting(names)
    )
    return PricedTables(tabled, tables_to_bytes(tables), equipment.model.options(tables), wired)
