"""What stands on the frontier's pictures: points with intervals, the line of the best, marks, all that was tried."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from ...text import counted, percent
from ..pareto import front
from ..points import Mark, Point, Rate, Tried
from .chart import COLOURS, GREY, INK, NAMES, SHAPES
from .labels import Label
from .room import FAINT, LINE
from .words import inputs_of, shorten

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .labels import Labels

_SIZE, _MARK_SIZE, _TRIED_SIZE = 34.0, 52.0, 9.0  # square points


def draw_tried(axes: "Axes", labels: "Labels", tried: Sequence[tuple[float, Tried]]) -> None:
    """Draw what was screened, faintly: where each stands, and what it is."""
    for inputs, colour in COLOURS.items():
        xs = [x for x, each in tried if each.inputs == inputs]
        ys = [each.rate.mean for _, each in tried if each.inputs == inputs]
        axes.scatter(xs, ys, s=_TRIED_SIZE, marker=SHAPES[inputs], color=colour, alpha=0.22, lw=0, zorder=1.5)
        labels.avoid(xs, ys, FAINT)
    if tried:
        axes.scatter([], [], s=_TRIED_SIZE, color=GREY, alpha=0.6, lw=0, label="tried")


def draw_best(axes: "Axes", labels: "Labels", best: Iterable[tuple[float, float]], name: str) -> None:
    """Draw the line of best points, (cost, rate) each: from each point on its rate is to be had, until a better one.

    A point that is best of its kind alone, as of those that decide alike, may lie below it.
    """
    corners = front(list(best), lambda place: place[0], lambda place: place[1], step=0.0)
    if not corners:
        return
    xs = [*(x for x, _ in corners), axes.get_xlim()[1]]
    ys = [*(y for _, y in corners), corners[-1][1]]
    axes.step(xs, ys, where="post", color=INK, lw=1.6, zorder=2.5, label=name)
    axes.fill_between(xs, ys, axes.get_ylim()[0], step="post", color=INK, alpha=0.04, lw=0, zorder=0.5)
    for (x, y), (after, higher) in zip(zip(xs, ys, strict=True), zip(xs[1:], ys[1:], strict=True), strict=False):
        labels.avoid_line((x, after, after), (y, y, higher))


def draw_points(axes: "Axes", labels: "Labels", points: Sequence[tuple[float, Point, bool]]) -> None:
    """Draw points with intervals: where each stands, and whether it is one of the best (filled) or not (hollow)."""
    for inputs, colour in COLOURS.items():
        some = [(x, point.rate, best) for x, point, best in points if point.setting.inputs == inputs]
        _whiskers(axes, labels, [(x, rate) for x, rate, _ in some], colour)
        for filled in (True, False):
            xs = [x for x, _, best in some if best == filled]
            ys = [rate.mean for _, rate, best in some if best == filled]
            face = colour if filled else "white"
            axes.scatter(xs, ys, s=_SIZE, marker=SHAPES[inputs], facecolor=face, edgecolor=colour, lw=1.2, zorder=4)
            labels.avoid(xs, ys)
        if some:
            axes.scatter([], [], s=_SIZE, marker=SHAPES[inputs], color=colour, label=NAMES[inputs])
    if not all(best for *_, best in points):
        axes.scatter([], [], s=_SIZE, facecolor="white", edgecolor=GREY, lw=1.2, label="not the best here")


def draw_tails(axes: "Axes", labels: "Labels", tails: Iterable[tuple[float, float, Point]]) -> None:
    """Draw lines from the mean to the end of what each point takes."""
    for start, end, point in tails:
        colour = COLOURS[point.setting.inputs]
        level = (point.rate.mean, point.rate.mean)
        axes.plot((start, end), level, color=colour, lw=0.9, alpha=0.45, marker="|", ms=5, markevery=[1])
        labels.avoid_line((start, end), level, LINE / 3)


def draw_marks(axes: "Axes", labels: "Labels", marks: Sequence[tuple[float, Mark]]) -> None:
    """Draw marks with their intervals, and write what they are."""
    _whiskers(axes, labels, [(x, mark.rate) for x, mark in marks], INK)
    xs, ys = [x for x, _ in marks], [mark.rate.mean for _, mark in marks]
    axes.scatter(xs, ys, s=_MARK_SIZE, marker="X", color=INK, edgecolor="white", lw=0.8, zorder=4.5)
    labels.avoid(xs, ys)


def ring(axes: "Axes", points: Iterable[tuple[float, Point]]) -> None:
    """Draw a ring around points."""
    for x, point in points:
        axes.scatter(
            [x], [point.rate.mean], s=4.5 * _SIZE, marker="o", facecolor="none", edgecolor=INK, lw=1.6, zorder=5
        )


def loud_label(x: float, point: Point, cost: str = "") -> Label:
    """Return the words for the point that the picture is about, and what it costs."""
    text = f"point {point.number}: {inputs_of(point)}\n{_and_rate(cost, point.rate)}"
    return Label(((x, point.rate.mean),), (text,), INK, size=9.5, bold=True)


def point_label(x: float, point: Point, words: str = "") -> Label:
    """Return the words for a point: where there is little room, its number."""
    texts = (f"{point.number}: {words}", str(point.number)) if words else (str(point.number),)
    return Label(((x, point.rate.mean),), texts, COLOURS[point.setting.inputs])


def mark_label(x: float, mark: Mark, cost: str = "") -> Label:
    """Return the words for a mark, and what it costs."""
    name = shorten(mark.name)
    if str(mark.n_switches) not in name:
        name = f"{name} ({counted(mark.n_switches, 'switch', 'switches')})"
    return Label(((x, mark.rate.mean),), (f"{name}\n{_and_rate(cost, mark.rate)}",), INK)


def _and_rate(cost: str, rate: Rate) -> str:
    return f"{cost}, {percent(rate.mean)}" if cost else percent(rate.mean)


def _whiskers(axes: "Axes", labels: "Labels", shown: Sequence[tuple[float, Rate]], colour: str) -> None:
    lows, highs = [rate.low for _, rate in shown], [rate.high for _, rate in shown]
    xs = [x for x, _ in shown]
    axes.vlines(xs, lows, highs, color=colour, lw=1.1, alpha=0.8, zorder=3)
    for x, low, high in zip(xs, lows, highs, strict=True):
        labels.avoid_line((x, x), (low, high))
