"""Rate against the number of switches: ours beside the rivals, and the frontier's points."""

from typing import TYPE_CHECKING, Literal

from ..points import Curve, Frontier, Rate
from .artists import draw_marks, draw_points, draw_tried, loud_label, mark_label, point_label, ring
from .chart import COLOURS, counts, key, rates, sheet
from .labels import Label, Labels
from .words import featured, shorten

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Dash = Literal["-"] | tuple[int, tuple[float, ...]]

# Ours are blue, as switches alone are everywhere; the rivals' colours are no inputs'; dashes tell the rest apart.
_OUR_COLOUR, _RIVALS = COLOURS["switches"], ("#A86F00", "#A3457C", "#6B6B6B")
_DASHES: "tuple[Dash, ...]" = ("-", (0, (5, 2)), (0, (1, 1.4)), (0, (6, 1.5, 1, 1.5)), (0, (9, 3)))
_FEW = 16  # switches: what fewer recognise may lie below the picture


def draw_switches(frontier: Frontier) -> "Figure":
    """Return rate against the number of switches, logarithmic. To be called inside `painting`."""
    figure, axes = sheet(frontier, "What so many switches recognise")
    spoken_of = featured(frontier)
    points = [(float(len(each.switches)), each, True) for each in frontier.points if each.switches]
    marks = [(float(mark.n_switches), mark) for mark in frontier.marks if mark.n_switches]
    rates(axes, [*(each.rate for _, each, _ in points), *(mark.rate for _, mark in marks), *_shown(frontier.curves)])
    counts(axes, frontier.n_switches)

    labels = Labels(axes)
    tried = [each for each in frontier.tried if each.n_switches and each.rate.mean >= axes.get_ylim()[0]]
    draw_tried(axes, labels, [(each.n_switches, each) for each in tried])
    names = list(_draw_curves(axes, labels, frontier.curves))
    draw_points(axes, labels, points)
    draw_marks(axes, labels, marks)
    ring(axes, [(x, point) for x, point, _ in points if point is spoken_of])
    key(axes)
    labels.write(*(loud_label(x, point) for x, point, _ in points if point is spoken_of))
    labels.write(*names, *(mark_label(x, mark) for x, mark in marks))
    labels.write(*(point_label(x, point) for x, point, _ in points if point is not spoken_of))
    return figure


def _shown(curves: tuple[Curve, ...]) -> list[Rate]:
    pairs = [pair for curve in curves for pair in zip(curve.sizes, curve.rates, strict=True)]
    return [rate for size, rate in pairs if size >= _FEW] or [rate for _, rate in pairs]


def _draw_curves(axes: "Axes", labels: Labels, curves: tuple[Curve, ...]) -> "Iterator[Label]":
    """Draw ours and the rivals' curves, and yield their names, ours first."""
    ours, rivals = ([curve for curve in curves if curve.ours == wanted] for wanted in (True, False))
    for number, curve in enumerate(ours):
        yield from _draw_curve(axes, labels, curve, _OUR_COLOUR, _DASHES[number % len(_DASHES)])
    for number, curve in enumerate(rivals):
        turn, colour = divmod(number, len(_RIVALS))
        yield from _draw_curve(axes, labels, curve, _RIVALS[colour], _DASHES[turn % len(_DASHES)])


def _draw_curve(axes: "Axes", labels: Labels, curve: Curve, colour: str, dash: "Dash") -> "Iterator[Label]":
    pairs = [(size, rate) for size, rate in zip(curve.sizes, curve.rates, strict=True) if size >= 1]
    if not pairs:
        return
    xs, means = [size for size, _ in pairs], [rate.mean for _, rate in pairs]
    width, shade, above = (2.4, 0.10, 3) if curve.ours else (1.1, 0.04, 2)
    axes.plot(xs, means, color=colour, lw=width, ls=dash, zorder=above)
    lows, highs = [rate.low for _, rate in pairs], [rate.high for _, rate in pairs]
    axes.fill_between(xs, lows, highs, color=colour, alpha=shade, lw=0, zorder=1)
    labels.avoid_line(xs, means)
    places = tuple(zip(xs, means, strict=True))
    seen = tuple(place for place in places if place[1] >= axes.get_ylim()[0])
    yield Label(seen or places, (shorten(curve.method),), colour, size=9.0 if curve.ours else 8.0, bold=curve.ours)
