"""One hand on a page: skin, unfolded sides, creases, names of the digits, and a circle for every switch."""

from typing import TYPE_CHECKING

import numpy as np

from ..body.anthropometry import DIGITS
from .flathand import Floats
from .handmap import RADIUS_MM, hand_map
from .handpanels import Dot, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SKIN, SIDE, LINE, CREASE, INK = "#f9f1e9", "#eee3d8", "#57493e", "#c9b09a", "#14304f"
_COLOURS, _LIGHTEST = "magma_r", 0.07  # a switch that closed at all is no longer white
_MARGIN_MM = 3.0
_LONGEST_TITLE = 40
_SPELT_OUT = 1.5  # printer's points per mm of the map from which on digits are named in full


def bounds() -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of a hand with all that is drawn of it, mm."""
    glove = hand_map()
    points = np.concatenate([glove.outline, *glove.strips, glove.labels])
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    # The names of the digits reach out beyond their places.
    return left - 2 * _MARGIN_MM, right + 3 * _MARGIN_MM, bottom - _MARGIN_MM, top + 2 * _MARGIN_MM


def colour(dot: Dot, graded: bool) -> str:
    """Return the colour that fills a dot: white when hollow, of the scale when `graded`, else ink."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    if dot.shade is None:
        return "white"
    return to_hex(colormaps[_COLOURS](_LIGHTEST + (1.0 - _LIGHTEST) * dot.shade)) if graded else INK


def paint(axes: "Axes", panel: Panel, number: int, points: float, graded: bool) -> None:
    """Draw hand `number` of a page, at `points` of a printer (1/72 inch) per mm; dots' ids are dot-NUMBER-SWITCH."""
    left, right, bottom, top = bounds()
    axes.set(xlim=(left, right), ylim=(bottom, top))
    axes.axis("off")
    _paint_skin(axes, points)
    for switch, (dot, place) in enumerate(zip(panel.dots, hand_map().places, strict=True)):
        paint_dot(axes, dot, place, RADIUS_MM, points, graded, f"{number}-{switch}")
    title = panel.title if len(panel.title) <= _LONGEST_TITLE else f"{panel.title[: _LONGEST_TITLE - 1]}…"
    middle = (left + right) / 2
    axes.text(middle, top, panel.note, fontsize=min(8.0, 4.5 * points), color=LINE, ha="center", va="bottom")
    large = min(12.0, 6.8 * points)
    axes.annotate(
        title, (middle, top), (0, 1.2 * large), textcoords="offset points", fontsize=large, weight="bold", ha="center"
    )


def paint_dot(
    axes: "Axes", dot: Dot, place: Floats, radius: float, points: float, graded: bool, identity: str = ""
) -> None:
    """Draw one switch at `place` (2,); `radius` in units of the axes, of `points` each."""
    from matplotlib.patches import Circle

    x, y = place.tolist()
    circle = Circle((x, y), 0.25 * radius if dot.absent else radius, facecolor=colour(dot, graded), clip_on=False)
    circle.set(edgecolor=LINE, linewidth=0.16 * points * radius / RADIUS_MM, zorder=3)
    circle.set_gid(f"dot-{identity}" if identity else None)
    axes.add_patch(circle)
    if not dot.mark:
        return
    ink = "white" if dot.shade is not None else INK
    size = 2.0 * radius * points * (0.49 if len(dot.mark) > 2 else 0.62)
    text = axes.text(x, y, dot.mark, fontsize=size, color=ink, ha="center", va="center_baseline", zorder=4)
    text.set_gid(f"mark-{identity}" if identity else None)


def _paint_skin(axes: "Axes", points: float) -> None:
    glove, thin = hand_map(), 0.16 * points
    axes.fill(*glove.outline.T, facecolor=SKIN, edgecolor=LINE, linewidth=2.4 * thin, joinstyle="round")
    for outline in glove.strips:
        axes.fill(*outline.T, facecolor=SIDE, edgecolor=LINE, linewidth=thin, joinstyle="round")
    for crease in glove.creases:
        axes.plot(*crease.T, color=CREASE, linewidth=2.0 * thin, solid_capstyle="round")
    for digit, (x, y) in zip(DIGITS, glove.labels.tolist(), strict=True):
        name = digit if points >= _SPELT_OUT else digit[0].upper()
        size = min(9.0, max(5.0, 4.2 * points))
        axes.text(x, y, name, fontsize=size, color=LINE, ha="center", va="center")
