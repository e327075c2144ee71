"""Where there is room for a label: beside its place, off what is drawn, and on no other label."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Box = tuple[float, float, float, float]  # left, bottom, right, top

# What a label costs, beside its distance in points: for every point of something drawn that it covers ...
MARKER, LINE, FAINT = 60.0, 6.0, 0.5
# ... for every marker, and for every label, that the line which leads to it crosses ...
_MARKER_CROSSED, _LABEL_CROSSED = 150.0, 600.0
# ... and for covering a label or leaving the picture, which is out of the question.
_FORBIDDEN = 1e6

# All lengths are points, 1/72 inch.
NEAR = (7.0, 11.0)
ANYWHERE = (*NEAR, 16.0, 23.0, 32.0, 43.0, 56.0, 72.0, 92.0, 116.0, 145.0, 180.0, 220.0, 270.0, 330.0, 400.0)
LED_FROM = 16.0  # a label this far away needs a line that leads to it
_APART = 2.0  # kept free around a label
_BESIDE = 5.0  # a leading line may pass a marker's centre no nearer than this

_TURNS = np.arange(24) * (math.tau / 24) + 0.5  # first to the right and a little above
_DIRECTIONS: Floats = np.column_stack((np.cos(_TURNS), np.sin(_TURNS)))
_ALONG: Floats = np.linspace(0, 1, 40)[:, None]


@dataclass(frozen=True, slots=True)
class Place:
    """Where a label stands: the centre of its box, for which of its anchors, how far from it, and what that costs."""

    anchor: int
    centre: tuple[float, float]
    radius: float
    cost: float


@dataclass(slots=True)
class Room:
    """The inside of `frame`, in points. The same calls give the same places: of equals, the first candidate."""

    frame: Box
    _drawn: list[Floats] = field(default_factory=list)  # (n, 3): x, y, weight
    _taken: list[Box] = field(default_factory=list)

    def avoid(self, points: Floats, weight: float) -> None:
        """Keep labels off `points` (n, 2) as far as `weight` goes."""
        self._drawn.append(np.column_stack((points, np.full(len(points), weight))))

    def place(self, anchors: Floats, size: tuple[float, float], radii: Sequence[float] = ANYWHERE) -> Place:
        """Return the cheapest place for a box of that size beside one of `anchors` (n, 2)."""
        best = None
        for radius in radii:
            if best is not None and best.cost <= radius:
                break
            found = self._around(anchors, np.array(size), radius)
            best = found if best is None or found.cost < best.cost else best
        assert best is not None
        return best

    def take(self, place: Place, anchors: Floats, size: tuple[float, float]) -> None:
        """Keep later labels off a box at `place`, and off the line that leads to it."""
        centre, half = np.array(place.centre), np.array(size) / 2
        self._taken.append((*(centre - half), *(centre + half)))
        if place.radius >= LED_FROM:
            start = anchors[place.anchor]
            self.avoid(start + (centre - start) * _ALONG, MARKER)

    def _around(self, anchors: Floats, size: Floats, radius: float) -> Place:
        half = size / 2
        starts = np.repeat(anchors, len(_DIRECTIONS), axis=0)
        centres = starts + np.tile(_DIRECTIONS, (len(anchors), 1)) * (radius + half)
        lows, highs = centres - half - _APART, centres + half + _APART
        costs = radius + self._covered(lows, highs) + _FORBIDDEN * self._outside(lows, highs)
        if radius >= LED_FROM:
            costs += self._crossed(starts, centres)
        least = int(np.argmin(costs))
        return Place(least // len(_DIRECTIONS), tuple(centres[least].tolist()), radius, float(costs[least]))

    def _covered(self, lows: Floats, highs: Floats) -> Floats:
        (left, bottom), (right, top) = lows.T[:, :, None], highs.T[:, :, None]
        drawn, taken = self._drawn_points(), np.array(self._taken).reshape(-1, 4)
        x, y, weight = drawn.T
        under = (left < x) & (x < right) & (bottom < y) & (y < top)
        overlaps = (left < taken[:, 2]) & (taken[:, 0] < right) & (bottom < taken[:, 3]) & (taken[:, 1] < top)
        costs: Floats = under @ weight + _FORBIDDEN * overlaps.sum(axis=1)
        return costs

    def _outside(self, lows: Floats, highs: Floats) -> NDArray[np.bool_]:
        left, bottom, right, top = self.frame
        return np.logical_or((lows < (left, bottom)).any(axis=1), (highs > (right, top)).any(axis=1))

    def _crossed(self, starts: Floats, centres: Floats) -> Floats:
        """Return what the lines from `starts` to `centres` cost for the labels and markers that they cross."""
        x, y = (starts + (centres - starts) * _ALONG[:, None]).T[:, :, :, None]  # (candidates, steps, 1)
        taken = np.array(self._taken).reshape(-1, 4)
        on_labels = (x > taken[:, 0]) & (x < taken[:, 2]) & (y > taken[:, 1]) & (y < taken[:, 3])
        drawn = self._drawn_points()
        markers = drawn[drawn[:, 2] >= MARKER, :2]
        on_markers = (x - markers[:, 0]) ** 2 + (y - markers[:, 1]) ** 2 < _BESIDE**2
        own = ((starts[:, None] - markers) ** 2).sum(axis=2) < 1
        labels, crossed = on_labels.any(axis=1).sum(axis=1), (on_markers.any(axis=1) & ~own).sum(axis=1)
        costs: Floats = _LABEL_CROSSED * labels + _MARKER_CROSSED * crossed
        return costs

    def _drawn_points(self) -> Floats:
        return np.concatenate(self._drawn) if self._drawn else np.empty((0, 3))
