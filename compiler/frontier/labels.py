"""Place labels next to what they name: off drawn objects, and never on each other."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..pictures import for_letters

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase

Floats = NDArray[np.float64]

# Costs of a label in addition to its distance in points: for every covered point of a drawn object ...
MARKER, LINE, FAINT = 60.0, 6.0, 0.5
# ... for every marker, and for every label, that its leader line crosses ...
_MARKER_CROSSED, _LABEL_CROSSED = 150.0, 600.0
# ... and for covering a label or leaving the picture, which must not happen.
_FORBIDDEN = 1e6

# All lengths are points, 1/72 inch.
_NEAR = (7.0, 11.0)
_ANYWHERE = (*_NEAR, 16.0, 23.0, 32.0, 43.0, 56.0, 72.0, 92.0, 116.0, 145.0, 180.0, 220.0, 270.0, 330.0, 400.0)
_LED_FROM = 16.0  # a label at least this far away needs a leader line
_APART = 2.0  # kept free around a label
_BESIDE = 5.0  # a leader line keeps this distance from a marker's centre
_STEP = 2.0  # between the sampled points of a line

_TURNS = np.arange(24) * (math.tau / 24) + 0.5  # first to the right and a little above
_DIRECTIONS: Floats = np.column_stack((np.cos(_TURNS), np.sin(_TURNS)))
_ALONG: Floats = np.linspace(0, 1, 40)[:, None]


@dataclass(frozen=True, slots=True)
class Label:
    """Text for a point at `at`, in data coordinates; of several places, the best one is labelled.

    texts  variants, longest first: the last is always written, an earlier one only if there is room for it
    """

    at: tuple[tuple[float, float], ...]
    texts: tuple[str, ...]
    colour: str
    size: float = 8.0
    bold: bool = False


class _Place(NamedTuple):
    """A possible place of a label: the centre of its box, the anchor, the distance from it, and the cost."""

    anchor: int
    centre: Floats
    radius: float
    cost: float


class Labels:
    """The labels of `axes`, whose limits and scales are final.

    Call `avoid` and `avoid_line` before `write`. The same calls give the same places: of equals, the first candidate.
    """

    def __init__(self, axes: "Axes") -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        figure = axes.get_figure(root=True)
        assert figure is not None
        self.axes = axes
        self._renderer: RendererBase = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
        self._points = 72 / figure.dpi
        frame = axes.get_window_extent()
        self._frame = tuple(edge * self._points for edge in (frame.x0, frame.y0, frame.x1, frame.y1))
        self._drawn: Floats = np.empty((0, 3))  # x, y, weight
        self._taken: Floats = np.empty((0, 4))  # left, bottom, right, top

    def avoid(self, xs: Sequence[float], ys: Sequence[float], weight: float = MARKER) -> None:
        """Keep labels off these places, in data coordinates, with this weight."""
        self._avoid(self._on_paper(xs, ys), weight)

    def avoid_line(self, xs: Sequence[float], ys: Sequence[float], weight: float = LINE) -> None:
        """Keep labels off the line through these places."""
        for start, end in itertools.pairwise(self._on_paper(xs, ys)):
            steps = 2 + math.ceil(math.dist(start, end) / _STEP)
            self._avoid(start + (end - start) * np.linspace(0, 1, steps)[:, None], weight)

    def write(self, *labels: Label) -> None:
        """Write each label at the best remaining place."""
        for label in labels:
            anchors = self._on_paper(*zip(*label.at, strict=True))
            for text in label.texts[:-1]:
                if self._write(label, text, anchors, _NEAR, dearest=_NEAR[-1] + LINE):
                    break
            else:
                self._write(label, label.texts[-1], anchors, _ANYWHERE, dearest=math.inf)

    def _avoid(self, points: Floats, weight: float) -> None:
        self._drawn = np.concatenate((self._drawn, np.column_stack((points, np.full(len(points), weight)))))

    def _write(self, label: Label, text: str, anchors: Floats, radii: Sequence[float], dearest: float) -> bool:
        style: dict[str, Any] = {
            **{"ha": "center", "va": "center", "ma": "center", "zorder": 6, "color": for_letters(label.colour)},
            **{"fontsize": label.size, "fontweight": "bold" if label.bold else "normal"},
        }
        probe = self.axes.text(0, 0, text, **style)
        extent = probe.get_window_extent(self._renderer)
        probe.remove()
        size = np.array((extent.width, extent.height)) * self._points
        place = self._best(anchors, size, radii)
        if place.cost > dearest:
            return False
        start, led = anchors[place.anchor], place.radius >= _LED_FROM
        self._taken = np.concatenate((self._taken, [[*(place.centre - size / 2), *(place.centre + size / 2)]]))
        if led:
            self._avoid(start + (place.centre - start) * _ALONG, MARKER)
        leader = {"arrowstyle": "-", "color": label.colour, "lw": 0.6, "shrinkA": 1, "shrinkB": 3} if led else None
        offset = tuple(place.centre - start)
        self.axes.annotate(text, label.at[place.anchor], offset, textcoords="offset points", arrowprops=leader, **style)
        return True

    def _best(self, anchors: Floats, size: Floats, radii: Sequence[float]) -> _Place:
        """Return the cheapest place for a box of that size next to one of `anchors` (n, 2)."""
        best = self._around(anchors, size, radii[0])
        for radius in radii[1:]:
            if best.cost <= radius:
                break
            found = self._around(anchors, size, radius)
            best = found if found.cost < best.cost else best
        return best

    def _around(self, anchors: Floats, size: Floats, radius: float) -> _Place:
        half = size / 2
        starts = np.repeat(anchors, len(_DIRECTIONS), axis=0)
        centres = starts + np.tile(_DIRECTIONS, (len(anchors), 1)) * (radius + half)
        lows, highs = centres - half - _APART, centres + half + _APART
        outside = np.logical_or((lows < self._frame[:2]).any(axis=1), (highs > self._frame[2:]).any(axis=1))
        costs = radius + self._covered(lows, highs) + _FORBIDDEN * outside
        if radius >= _LED_FROM:
            costs += self._crossed(starts, centres)
        least = int(np.argmin(costs))
        return _Place(least // len(_DIRECTIONS), centres[least], radius, float(costs[least]))

    def _covered(self, lows: Floats, highs: Floats) -> Floats:
        (left, bottom), (right, top) = lows.T[:, :, None], highs.T[:, :, None]
        x, y, weight = self._drawn.T
        taken = self._taken
        under = (left < x) & (x < right) & (bottom < y) & (y < top)
        overlaps = (left < taken[:, 2]) & (taken[:, 0] < right) & (bottom < taken[:, 3]) & (taken[:, 1] < top)
        costs: Floats = under @ weight + _FORBIDDEN * overlaps.sum(axis=1)
        return costs

    def _crossed(self, starts: Floats, centres: Floats) -> Floats:
        """Return the cost of the labels and markers that the lines from `starts` to `centres` cross."""
        x, y = (starts + (centres - starts) * _ALONG[:, None]).T[:, :, :, None]  # (candidates, steps, 1)
        taken, markers = self._taken, self._drawn[self._drawn[:, 2] >= MARKER, :2]
        on_labels = (x > taken[:, 0]) & (x < taken[:, 2]) & (y > taken[:, 1]) & (y < taken[:, 3])
        on_markers = (x - markers[:, 0]) ** 2 + (y - markers[:, 1]) ** 2 < _BESIDE**2
        own = ((starts[:, None] - markers) ** 2).sum(axis=2) < 1
        labels, crossed = on_labels.any(axis=1).sum(axis=1), (on_markers.any(axis=1) & ~own).sum(axis=1)
        costs: Floats = _LABEL_CROSSED * labels + _MARKER_CROSSED * crossed
        return costs

    def _on_paper(self, xs: Sequence[float], ys: Sequence[float]) -> Floats:
        pairs = np.column_stack((np.asarray(xs, np.float64), np.asarray(ys, np.float64)))
        return np.asarray(self.axes.transData.transform(pairs), np.float64) * self._points
