"""Labels that stand beside what they name, and never on each other."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .room import ANYWHERE, LED_FROM, LINE, MARKER, NEAR, Floats, Room

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase

_STEP = 2.0  # points, between those that stand for a line


@dataclass(frozen=True, slots=True)
class Label:
    """Words for what stands at `at`, in data coordinates; where there are several places, for the best of them.

    texts  what to write, dearest first: the last is always written, an earlier one only where there is room beside it
    """

    at: tuple[tuple[float, float], ...]
    texts: tuple[str, ...]
    colour: str
    size: float = 8.0
    bold: bool = False


class Labels:
    """The labels of `axes`, whose limits and scales are final. `avoid` is told what is drawn before that."""

    def __init__(self, axes: "Axes") -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        figure = axes.get_figure(root=True)
        assert figure is not None
        self._axes = axes
        self._renderer: RendererBase = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
        self._points = 72 / figure.dpi
        frame = axes.get_window_extent()
        left, bottom, right, top = (edge * self._points for edge in (frame.x0, frame.y0, frame.x1, frame.y1))
        self._room = Room((left, bottom, right, top))

    def avoid(self, xs: Sequence[float], ys: Sequence[float], weight: float = MARKER) -> None:
        """Keep labels off these places, in data coordinates."""
        self._room.avoid(self._on_paper(xs, ys), weight)

    def avoid_line(self, xs: Sequence[float], ys: Sequence[float], weight: float = LINE) -> None:
        """Keep labels off the line through these places."""
        corners = self._on_paper(xs, ys)
        for start, end in itertools.pairwise(corners):
            steps = 2 + math.ceil(math.dist(start, end) / _STEP)
            self._room.avoid(start + (end - start) * np.linspace(0, 1, steps)[:, None], weight)

    def write(self, *labels: Label) -> None:
        """Write each label at the best place that is left."""
        for label in labels:
            self._write_one(label)

    def _write_one(self, label: Label) -> None:
        anchors = self._on_paper(*zip(*label.at, strict=True))
        for text in label.texts[:-1]:
            if self._write(label, text, anchors, NEAR, dearest=NEAR[-1] + LINE):
                return
        self._write(label, label.texts[-1], anchors, ANYWHERE, dearest=math.inf)

    def _write(self, label: Label, text: str, anchors: Floats, radii: Sequence[float], dearest: float) -> bool:
        size = self._size(label, text)
        place = self._room.place(anchors, size, radii)
        if place.cost > dearest:
            return False
        self._room.take(place, anchors, size)
        leader = {"arrowstyle": "-", "color": label.colour, "lw": 0.6, "shrinkA": 1, "shrinkB": 3}
        self._axes.annotate(
            text,
            label.at[place.anchor],
            tuple(np.array(place.centre) - anchors[place.anchor]),
            textcoords="offset points",
            arrowprops=leader if place.radius >= LED_FROM else None,
            **self._style(label),
        )
        return True

    def _size(self, label: Label, text: str) -> tuple[float, float]:
        probe = self._axes.text(0, 0, text, **self._style(label))
        extent = probe.get_window_extent(self._renderer)
        probe.remove()
        return extent.width * self._points, extent.height * self._points

    @staticmethod
    def _style(label: Label) -> dict[str, Any]:
        weight = "bold" if label.bold else "normal"
        return {
            "ha": "center",
            "va": "center",
            "ma": "center",
            "color": label.colour,
            "fontsize": label.size,
            "fontweight": weight,
            "zorder": 6,
        }

    def _on_paper(self, xs: Sequence[float], ys: Sequence[float]) -> Floats:
        pairs = np.column_stack((np.asarray(xs, np.float64), np.asarray(ys, np.float64)))
        return np.asarray(self._axes.transData.transform(pairs), np.float64) * self._points
