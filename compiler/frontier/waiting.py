"""How long finalists keep one waiting: tables of rows that the stream does not hold, under every way to decide."""

import hashlib
from dataclasses import dataclass

import msgspec
import numpy as np
from msgspec import Struct

from ..evaluation.folds import Fold
from ..samples import Columns
from .material import Material
from .points import DecisionKind, Latency
from .pricing import PriceKey, Tabled, tables_of
from .streaming.latency import Decider, latency
from .streaming.stream import Stream

DECISIONS: tuple[DecisionKind, ...] = ("single", "dwell", "sequential")


class Pace(Struct, frozen=True):
    """Tables that answer every `frame_us`, and the ways to decide on what they answer."""

    tabled: Tabled
    frame_us: float
    decisions: tuple[DecisionKind, ...]


class WaitKey(Struct, frozen=True):
    """Which latencies: of tables on these switches and perhaps the joints, trained on a fold, at these paces, over the
    stream of this digest.
    """

    columns: Columns
    joints: bool
    fold: str
    stream: str
    paces: tuple[Pace, ...]
    max_bins: int | None


class Waited(Struct, frozen=True):
    """The latencies, of every pace one for each of its decisions."""

    latencies: tuple[tuple[Latency, ...], ...]


def digest(stream: Stream) -> str:
    """Return what identifies a stream in a store: a digest of all that it holds."""
    found = hashlib.sha256(msgspec.json.encode((stream.bits.shape, stream.codes.shape, len(stream.arrivals))))
    for array in (stream.bits, stream.codes, stream.at_us, stream.types, stream.arrivals, stream.ends):
        found.update(np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes())
    return found.hexdigest()[:16]


@dataclass(frozen=True, slots=True, eq=False)
class WaitTask:
    """Train on a fold's rows, then see how long a stream keeps one waiting for decisions."""

    key: WaitKey
    material: Material
    fold: Fold
    stream: Stream
    cost: float


def find_latencies(task: WaitTask) -> Waited:
    """Return what `task` asks for."""
    key = task.key
    asked = tuple(dict.fromkeys(pace.tabled for pace in key.paces))
    priced = PriceKey(key.columns, key.joints, asked, key.max_bins, ())
    tables = tables_of(task.material, priced, task.fold.train)
    return Waited(
        tuple(
            tuple(
                latency(tables[pace.tabled], key.columns, key.joints, task.stream, pace.frame_us, Decider(kind))
                for kind in pace.decisions
            )
            for pace in key.paces
        )
    )
