"""Transitions between grasp types: counts of changes from segment to segment, and a graph of them.

Nothing held between two grasps is skipped: PoS, nothing, PMF is a change from PoS to PMF.
"""

from cmath import rect
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi
from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.files import read_file

from ..recordings.graspset import GraspSet
from .segments import segments_of
from .streams import MovementError, streams_of

# Rarer transitions are not admissible, and are drawn faintly.
FREQUENT = 0.1
_LARGEST = 1 << 24


class TransitionFile(Struct, frozen=True, forbid_unknown_fields=True):
    """The JSON form of a graph: counts[i][j] segments of types[i] were followed by one of types[j].

    `probabilities` are the counts divided by the sum of their row, 0 where that is 0.
    """

    types: tuple[str, ...]
    counts: tuple[tuple[int, ...], ...]
    probabilities: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Transitions:
    """Changes between types: `counts` (K, K), from the row's type to the column's."""

    types: tuple[str, ...]
    counts: NDArray[np.intp]

    @classmethod
    def of(cls, sequences: Iterable[Sequence[str]], types: Sequence[str]) -> "Transitions":
        """Count the changes in sequences of types."""
        counts, place = np.zeros((len(types), len(types)), np.intp), {name: at for at, name in enumerate(types)}
        for sequence in sequences:
            for one, other in pairwise(sequence):
                counts[place[one], place[other]] += 1
        return cls(tuple(types), counts)

    @classmethod
    def of_set(cls, grasp_set: GraspSet) -> "Transitions":
        """Count the changes in the true segments of a set. Raises MovementError if rows are not movements."""
        names, labels = grasp_set.taxonomy.types, grasp_set.labels
        types = sorted(set(labels[~grasp_set.is_none].tolist()))
        streams = [segments_of(labels[stream.rows], len(names)) for stream in streams_of(grasp_set)]
        return cls.of(([names[one.state] for one in stream] for stream in streams), [names[one] for one in types])

    @classmethod
    def load(cls, path: Path) -> "Transitions":
        """Load a file written by `save`. Raises MovementError that names the file, OSError."""
        try:
            file = msgspec.json.decode(read_file(path, _LARGEST, MovementError), type=TransitionFile)
            counts = np.array(file.counts, np.intp).reshape(len(file.types), len(file.types))
        except (msgspec.DecodeError, UnicodeDecodeError, ValueError, OverflowError) as wrong:
            raise MovementError(f"{path} is not a transitions file: {wrong}") from None
        return cls(file.types, counts)

    @property
    def probabilities(self) -> NDArray[np.float64]:
        """The share of each successor type among the changes of a type, (K, K); zero rows for types without changes."""
        counts = self.counts.astype(np.float64)
        return np.asarray(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1))

    def frequent(self, grasp: str) -> tuple[str, ...]:
        """Return the types that follow `grasp` in at least FREQUENT of its changes, the most frequent first."""
        if grasp not in self.types:
            return ()
        row = self.probabilities[self.types.index(grasp)]
        return tuple(self.types[at] for at in np.argsort(-row, kind="stable").tolist() if row[at] >= FREQUENT)

    def to_json(self) -> bytes:
        """Return the content of its file."""
        rounded = self.probabilities.round(6).tolist()
        file = TransitionFile(self.types, tuple(map(tuple, self.counts.tolist())), tuple(map(tuple, rounded)))
        return msgspec.json.encode(file) + b"\n"


# The picture's side, the radius of the circle of types, and the radius of a type, reduced if there are many.
SIZE, _CIRCLE, _LARGEST_DOT = 720, 262.0, 21.0
# Places in the picture are complex numbers, y downwards.
_MIDDLE = SIZE / 2 * (1 + 1j)
Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Graph:
    """Types on a circle, and changes as arrows between them, the rarest first so that frequent ones are on top.

    nodes  name, place, the place of the name outside, its alignment ("start", ...), and words
    edges  path (a value of `d`), tip (of the arrow's `points`), width, opacity and words
    """

    nodes: tuple[tuple[str, Place, Place, str, str], ...]
    edges: tuple[tuple[str, str, float, float, str], ...]
    radius: float
    size: int = SIZE


def graph_of(transitions: Transitions) -> Graph:
    """Return the graph as shapes, in a square of SIZE."""
    types, counts, shares, K = transitions.types, transitions.counts, transitions.probabilities, len(transitions.types)
    dot = round(min(_LARGEST_DOT, 0.8 * pi * _CIRCLE / max(K, 1)), 1)
    angles = [2 * pi * number / K - pi / 2 for number in range(K)]
    places = [_MIDDLE + rect(_CIRCLE, angle) for angle in angles]
    nodes = []
    for name, angle, place, row in zip(types, angles, places, counts, strict=True):
        label = _MIDDLE + rect(_CIRCLE + dot + 10, angle) + 5j
        anchor = "middle" if abs(cos(angle)) < 0.2 else "start" if cos(angle) > 0 else "end"
        nodes.append((name, _rounded(place), _rounded(label), anchor, f"{name}: followed {int(row.sum())} times"))
    edges = [
        _edge(
            places[a],
            places[b],
            angles[a],
            dot,
            share,
            f"{types[a]} to {types[b]}: {counts[a, b]} of {counts[a].sum()} ({share:.0%})",
        )
        for share, a, b in sorted((float(shares[a, b]), a, b) for a, b in np.argwhere(counts).tolist())
    ]
    return Graph(tuple(nodes), tuple(edges), dot)


def _edge(
    start: complex, end: complex, angle: float, dot: float, share: float, words: str
) -> tuple[str, str, float, float, str]:
    """Return the arrow from one type to another, or a loop outside the circle.

    Arrows bend towards the middle, so that both directions are apart.
    """
    width, opacity = 1 + 6 * share, 0.12 if share < FREQUENT else min(1.0, 0.35 + share)
    if start == end:
        angle += 1.2  # past the name
        first = start + rect(dot, angle)
        path = "M{} C{} {} {}".format(*map(_point, (first, *(first + rect(26, angle + d) for d in (-1, 1)), first)))
        return path, "", round(width, 2), round(opacity, 2), words
    # To the right of the straight line, and towards the middle.
    bend = (start + end) / 2 * 0.6 + _MIDDLE * 0.4 + (end - start) * 0.12j
    ahead = (end - bend) / (abs(end - bend) or 1.0)
    last, side = _towards(end, bend, dot + 9), ahead * 1j * (3 + width / 2)
    tip = " ".join(map(_point, (_towards(end, bend, dot), last + side, last - side)))
    path = f"M{_point(_towards(start, bend, dot))} Q{_point(bend)} {_point(last)}"
    return path, tip, round(width, 2), round(opacity, 2), words


def _towards(place: complex, other: complex, far: float) -> complex:
    return place + far * (other - place) / (abs(other - place) or 1.0)


def _rounded(place: complex) -> tuple[float, float]:
    return round(place.real, 1), round(place.imag, 1)


def _point(place: complex) -> str:
    return f"{place.real:.1f},{place.imag:.1f}"
