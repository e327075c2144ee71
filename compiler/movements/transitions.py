"""Transitions between grasp types: counts of changes from segment to segment, and a graph of them.

Nothing held between two grasps is skipped: PoS, nothing, PMF is a change from PoS to PMF.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, hypot, pi, sin
from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.files import read_file

from ..recordings.graspset import GraspSet
from .scores import segments_of
from .streams import MovementError, streams_of
from .timeline import Timeline

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
    def of_timelines(cls, timelines: Sequence[Timeline]) -> "Transitions":
        """Count the changes in segments found in streams of the same types."""
        every = ([one.type for one in timeline.segments()] for timeline in timelines)
        return cls.of(every, timelines[0].types if timelines else ())

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
    types, every, shares, K = transitions.types, transitions.counts, transitions.probabilities, len(transitions.types)
    dot = round(min(_LARGEST_DOT, 0.8 * pi * _CIRCLE / max(K, 1)), 1)
    angles = [2 * pi * number / K - pi / 2 for number in range(K)]
    places = [(SIZE / 2 + _CIRCLE * cos(angle), SIZE / 2 + _CIRCLE * sin(angle)) for angle in angles]
    nodes = []
    for name, angle, (x, y), counts in zip(types, angles, places, every, strict=True):
        reach = _CIRCLE + dot + 10
        label = SIZE / 2 + reach * cos(angle), SIZE / 2 + reach * sin(angle) + 5
        anchor = "middle" if abs(cos(angle)) < 0.2 else "start" if cos(angle) > 0 else "end"
        nodes.append(
            (
                name,
                (round(x, 1), round(y, 1)),
                (round(label[0], 1), round(label[1], 1)),
                anchor,
                f"{name}: followed {int(counts.sum())} times",
            )
        )
    changes = [(float(shares[a, b]), a, b) for a, b in np.argwhere(every).tolist()]
    edges = [
        _edge(
            places[a],
            places[b],
            angles[a],
            dot,
            share,
            f"{types[a]} to {types[b]}: {every[a, b]} of {every[a].sum()} ({share:.0%})",
        )
        for share, a, b in sorted(changes)
    ]
    return Graph(tuple(nodes), tuple(edges), dot)


def _edge(
    start: Place, end: Place, angle: float, dot: float, share: float, words: str
) -> tuple[str, str, float, float, str]:
    """Return the arrow from one type to another, or a loop outside the circle.

    Arrows bend towards the middle, so that both directions are apart.
    """
    width, opacity = 1 + 6 * share, 0.12 if share < FREQUENT else min(1.0, 0.35 + share)
    if start == end:
        angle += 1.2  # past the name
        x, y = start[0] + dot * cos(angle), start[1] + dot * sin(angle)
        turned = [(x + 26 * cos(angle + turn), y + 26 * sin(angle + turn)) for turn in (-1.0, 1.0)]
        points = [(x, y), *turned, (x, y)]
        path = "M{} C{} {} {}".format(*map(_point, points))
        return path, "", round(width, 2), round(opacity, 2), words
    middle = SIZE / 2
    dx, dy = end[0] - start[0], end[1] - start[1]
    # To the right of the straight line, and towards the middle.
    bend = (
        (start[0] + end[0]) / 2 * 0.6 + middle * 0.4 - dy * 0.12,
        (start[1] + end[1]) / 2 * 0.6 + middle * 0.4 + dx * 0.12,
    )
    first, last = _towards(start, bend, dot), _towards(end, bend, dot + 9)
    ux, uy = (end[0] - bend[0]), (end[1] - bend[1])
    length = hypot(ux, uy) or 1.0
    ux, uy, half = ux / length, uy / length, 3 + width / 2
    point = _towards(end, bend, dot)
    tip = [point, (last[0] - uy * half, last[1] + ux * half), (last[0] + uy * half, last[1] - ux * half)]
    path = f"M{_point(first)} Q{_point(bend)} {_point(last)}"
    return path, " ".join(map(_point, tip)), round(width, 2), round(opacity, 2), words


def _towards(place: Place, other: Place, far: float) -> Place:
    length = hypot(other[0] - place[0], other[1] - place[1]) or 1.0
    return (place[0] + far * (other[0] - place[0]) / length, place[1] + far * (other[1] - place[1]) / length)


def _point(place: Place) -> str:
    return f"{place[0]:.1f},{place[1]:.1f}"
