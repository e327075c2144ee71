"""Place labels next to what they name, off markers and never on each other."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..pictures import for_letters

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase

Floats = NDArray[np.float64]

# Distances of a label from its point, in points of 1/72 inch: those that a longer text may have, and all.
_NEAR = (7.0, 11.0)
_ANYWHERE = (*_NEAR, 16.0, 23.0, 32.0, 43.0, 56.0, 72.0, 92.0, 116.0, 145.0, 180.0, 220.0, 270.0, 330.0, 400.0)
_LED_FROM = 16.0  # a label at least this far away needs a leader line
_APART = 2.0  # kept free around a label

_TURNS = np.arange(24) * (math.tau / 24) + 0.5  # first to the right and a little above
_DIRECTIONS: Floats = np.column_stack((np.cos(_TURNS), np.sin(_TURNS)))


@dataclass(frozen=True, slots=True)
class ChartLabel:
    """Text for a point at `at`, in data coordinates; of several places, the first with room is labelled.

    texts  variants, longest first: the last is always written, an earlier one only if there is room for it
    """

    at: tuple[tuple[float, float], ...]
    texts: tuple[str, ...]
    colour: str
    size: float = 8.0
    bold: bool = False


class Labels:
    """The labels of `axes`, whose scales must not change any more."""

    def __init__(self, axes: "Axes") -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self.axes = axes
        figure = axes.get_figure(root=True)
        assert figure is not None
        self._renderer: RendererBase = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
        self._points = 72 / figure.dpi
        frame = axes.get_window_extent()
        self._frame = tuple(edge * self._points for edge in (frame.x0, frame.y0, frame.x1, frame.y1))
        self._markers: Floats = np.empty((0, 2))
        self._boxes: Floats = np.empty((0, 4))  # left, bottom, right, top

    def avoid(self, xs: Sequence[float], ys: Sequence[float]) -> None:
        """Keep labels off the markers at these places, in data coordinates."""
        self._markers = np.concatenate((self._markers, self._on_paper(xs, ys)))

    def write(self, *labels: ChartLabel) -> None:
        """Write each label at the nearest place with room."""
        for label in labels:
            anchors = self._on_paper(*zip(*label.at, strict=True))
            if not any(self._write(label, text, anchors, _NEAR) for text in label.texts[:-1]):
                self._write(label, label.texts[-1], anchors, _ANYWHERE)

    def _write(self, label: ChartLabel, text: str, anchors: Floats, radii: Sequence[float]) -> bool:
        """Write a text at the first radius with room, and return whether there is one."""
        style: dict[str, Any] = {
            **{"ha": "center", "va": "center", "ma": "center", "zorder": 6, "color": for_letters(label.colour)},
            **{"fontsize": label.size, "fontweight": "bold" if label.bold else "normal"},
        }
        probe = self.axes.text(0, 0, text, **style)
        extent = probe.get_window_extent(self._renderer)
        probe.remove()
        half = np.array((extent.width, extent.height)) * self._points / 2
        starts = np.repeat(np.arange(len(anchors)), len(_DIRECTIONS))
        for radius in radii:
            centres = anchors[starts] + np.tile(_DIRECTIONS, (len(anchors), 1)) * (radius + half)
            free = np.flatnonzero(self._free(centres - half - _APART, centres + half + _APART))
            if len(free):
                anchor, centre = int(starts[free[0]]), centres[free[0]]
                led = {"arrowstyle": "-", "color": label.colour, "lw": 0.6, "shrinkA": 1, "shrinkB": 3}
                style |= {"textcoords": "offset points", "arrowprops": led if radius >= _LED_FROM else None}
                self.axes.annotate(text, label.at[anchor], tuple(centre - anchors[anchor]), **style)
                self._boxes = np.concatenate((self._boxes, [[*(centre - half), *(centre + half)]]))
                return True
        return False

    def _free(self, lows: Floats, highs: Floats) -> NDArray[np.bool_]:
        """Return which boxes (n,) lie within the frame and on no label and no marker."""
        inside = (lows >= self._frame[:2]).all(axis=1) & (highs <= self._frame[2:]).all(axis=1)
        (left, bottom), (right, top) = lows.T[:, :, None], highs.T[:, :, None]
        boxes, (x, y) = self._boxes, self._markers.T
        on_labels = (left < boxes[:, 2]) & (boxes[:, 0] < right) & (bottom < boxes[:, 3]) & (boxes[:, 1] < top)
        on_markers = (left < x) & (x < right) & (bottom < y) & (y < top)
        return np.asarray(inside & ~on_labels.any(axis=1) & ~on_markers.any(axis=1))

    def _on_paper(self, xs: Sequence[float], ys: Sequence[float]) -> Floats:
        pairs = np.column_stack((np.asarray(xs, np.float64), np.asarray(ys, np.float64)))
        return np.asarray(self.axes.transData.transform(pairs), np.float64) * self._points
