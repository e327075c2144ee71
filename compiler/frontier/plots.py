"""A frontier's pictures: accuracy against the time of a frame, and against the number of switches."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from thenar.runtime.recipe import Inputs

from ..evaluation.rates import Rate
from ..pictures import on_paper, painting, rendered
from ..text import counted, duration, percent
from .points import Curve, Frontier, FrontierPoint, ReferencePoint, Tried, front
from .words import counted_of, elements_of, featured, inputs_of, mark_name, of_time, shorten

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Dash = Literal["-"] | tuple[int, tuple[float, ...]]

FONT = 9.0
_INK, _GREY, _PALE, _WHITE, _PICKED = map(on_paper, ("ink", "soft", "line", "paper", "picked"))
# Shapes as well as colours, for the colour-blind.
_COLOURS: dict[Inputs, str] = {inputs: on_paper(inputs) for inputs in ("switches", "joints", "both")}
_SHAPES: dict[Inputs, str] = {"switches": "o", "joints": "^", "both": "s"}
_MARKS = ("X", "P", "D", "v")
_NAMES: dict[Inputs, str] = {"switches": "switches alone", "joints": "joints alone", "both": "switches and joints"}
# Curves are blue, like switches alone everywhere; dashes distinguish curves of one colour. Trainers have other colours.
_TRAINERS = tuple(on_paper(f"baseline-{number}") for number in (1, 2, 3))
_DASHES: "tuple[Dash, ...]" = ("-", (0, (5, 2)), (0, (1, 1.4)), (0, (6, 1.5, 1, 1.5)), (0, (9, 3)))
# Ids of a point's marker and of the ring around the featured one, in SVG.
POINT_ID, RING_ID = "point-", "featured"

_WIDTH, _HEIGHT = 9.0, 7.0  # inches
_LEFT, _RIGHT, _BOTTOM, _TOP = 0.72, 0.18, 2.18, 0.72  # inches around the axes; the key is below them
_SIZE, _MARK_SIZE, _TRIED_SIZE = 34.0, 52.0, 9.0  # square points
_NUMBER = (13.0, 9.0)  # width and height of a number, in points of 1/72 inch
_LOWEST = 1.0  # microseconds or switches: a logarithmic axis has no 0, and nothing takes less
_FEW = 16  # switches: curves may leave the picture below the rate of this many


@dataclass(frozen=True, slots=True)
class _Cost:
    """The horizontal axis of a picture.

    front       the front whose points are filled and joined by a line called `best`; "": all are filled, none joined
    of_point, of_mark, of_tried  horizontal positions; None: not on this picture
    """

    title: str
    axis: str
    of_point: Callable[[FrontierPoint], float | None]
    of_mark: Callable[[ReferencePoint], float | None]
    of_tried: Callable[[Tried], float | None]
    front: str = ""
    best: str = ""

    @property
    def is_time(self) -> bool:
        """Whether the cost is in microseconds; else it is a number of switches."""
        return bool(self.front)


_FRAME = _Cost(
    title="Accuracy against frame time",
    axis="time of a frame: the glove read, the grasp classified",
    of_point=lambda point: point.frame.us,
    of_mark=lambda mark: mark.frame_us,
    of_tried=lambda tried: tried.frame_us,
    front="frame",
    best="the best for its time",
)
_SWITCHES = _Cost(
    title="Accuracy against the number of switches",
    axis="switches kept",
    of_point=lambda point: float(point.size) or None,
    of_mark=lambda mark: float(mark.n_switches) or None,
    of_tried=lambda tried: float(tried.n_switches) or None,
)


def pictures(frontier: Frontier, kind: Literal["svg", "png"], *, letters: bool = False) -> Mapping[str, bytes]:
    """Return "frontier" and "switches" as files; equal frontiers give equal bytes.

    With `letters`, text in SVG stays text instead of outlines. Raises PictureError.
    """
    with painting(FONT, letters=letters):
        return {name: rendered(draw(frontier), kind) for name, draw in PICTURES.items()}


def _draw(frontier: Frontier, cost: _Cost) -> "Figure":
    machine = f", {shorten(frontier.machine)}" if cost.is_time else ""
    figure, axes = _sheet(frontier, cost.title.replace("switches", counted_of(frontier)) + machine)
    marks = [(max(x, _LOWEST), mark) for mark in frontier.marks if (x := cost.of_mark(mark)) is not None]
    points = [(max(x, _LOWEST), point) for point in frontier.points if (x := cost.of_point(point)) is not None]
    curves = () if cost.is_time else frontier.curves
    pairs = [pair for curve in curves for pair in zip(curve.sizes, curve.rates, strict=True)]
    shown = [rate for size, rate in pairs if size >= _FEW] or [rate for _, rate in pairs]
    _scale_rates(axes, [*(point.rate for _, point in points), *(mark.rate for _, mark in marks), *shown], frontier.by)
    lowest = axes.get_ylim()[0]
    tried = [
        (max(x, _LOWEST), each)
        for each in frontier.tried
        if (x := cost.of_tried(each)) is not None and each.rate.mean >= lowest
    ]
    if cost.is_time:
        _scale_times(axes, [x for x, _ in (*marks, *tried, *points)])
    else:
        sensors = counted_of(frontier) == "sensors"
        there = max(each.n_switches for each in frontier.tried) if sensors else frontier.n_switches + frontier.n_levels
        _scale_counts(axes, there)
    untimed = cost.is_time and any(point.transfer.how == "unknown" for _, point in points)
    axis = cost.axis.replace("switches", counted_of(frontier))
    axis = of_time(frontier, axis) if cost.is_time else axis
    axes.set_xlabel(axis + "; reading the joints is left out" * untimed, color=_INK)

    said = duration if cost.is_time else lambda _: ""
    _draw_tried(axes, tried)
    if cost.is_time and len(frontier.trainers) > 1:
        _draw_trainers(axes, tried)
    if cost.is_time:
        _draw_best(axes, [(x, point.rate.mean) for x, point in points if cost.front in point.fronts], cost.best)
    _draw_curves(axes, curves)
    _draw_points(axes, points, cost.front, elements_of(frontier))
    _draw_whiskers(axes, [(x, mark.rate) for x, mark in marks], _INK)
    for number, (x, mark) in enumerate(marks):
        look: dict[str, Any] = {"marker": _MARKS[number % len(_MARKS)], "color": _INK, "edgecolor": _WHITE, "lw": 0.8}
        named = _named(shorten(mark_name(mark, frontier)), said(x), mark.rate)
        axes.scatter([x], [mark.rate.mean], s=_MARK_SIZE, zorder=4.5, label=named, **look)
    spoken_of = featured(frontier)
    _draw_numbers(axes, sorted(points, key=lambda place: place[1] is not spoken_of), marks)
    for x, point in points:
        if point is spoken_of:
            ring: dict[str, Any] = {"facecolor": "none", "edgecolor": _PICKED, "lw": 1.6, "zorder": 5}
            named = _named(f"point {point.number}: {inputs_of(frontier, point)}", said(x), point.rate)
            axes.scatter([x], [point.rate.mean], s=4.5 * _SIZE, gid=RING_ID, **ring)
            axes.scatter([], [], s=2 * _SIZE, label=named, **ring)
    if axes.get_legend_handles_labels()[0]:
        place = _LEFT / _WIDTH, (_BOTTOM - 0.5) / _HEIGHT
        figure.legend(loc="upper left", bbox_to_anchor=place, ncols=2, frameon=False, labelspacing=0.35)
    return figure


def _named(name: str, cost: str, rate: Rate) -> str:
    return ", ".join(filter(None, (name, cost, percent(rate.mean))))


# Call inside `painting`.
PICTURES: Mapping[str, Callable[[Frontier], "Figure"]] = MappingProxyType(
    {name: partial(_draw, cost=cost) for name, cost in (("frontier", _FRAME), ("switches", _SWITCHES))}
)


def _sheet(frontier: Frontier, title: str) -> tuple["Figure", "Axes"]:
    """Return a figure and its axes with a title, and a subtitle on data and protocol."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, _HEIGHT), dpi=144, facecolor=_WHITE)
    left, right, bottom, top = _LEFT / _WIDTH, _RIGHT / _WIDTH, _BOTTOM / _HEIGHT, _TOP / _HEIGHT
    under = (
        f"{shorten(frontier.source)}: {frontier.trials:,} trials of {counted(frontier.subjects, 'person', 'people')}, "
        f"{len(frontier.grasps)} types; "
        f"placement inside the fold, corrected for luck, 95 % intervals"
    )
    figure.text(left, 1 - 0.30 / _HEIGHT, title, fontsize=13, fontweight="bold", color=_INK)
    figure.text(left, 1 - 0.53 / _HEIGHT, under, fontsize=FONT, color=_GREY)
    axes = figure.add_axes((left, bottom, 1 - left - right, 1 - bottom - top))
    axes.set_axisbelow(True)
    axes.grid(color=_PALE, lw=0.6)
    axes.spines[["left", "bottom"]].set_color(_GREY)
    axes.tick_params(colors=_GREY, labelcolor=_INK)
    return figure, axes


def _scale_times(axes: "Axes", us: Iterable[float]) -> None:
    """Make the horizontal axis logarithmic, in times, with room for all of `us`."""
    known = list(us) or [100.0, 1000.0]
    low, high = min(known), max(known)
    room = max(1.15, (high / low) ** 0.07)
    axes.set_xscale("log")
    axes.set_xlim(low / room, high * room)
    within = _round_times(low / room, high * room)
    axes.set_xticks(within, [duration(tick) for tick in within])
    axes.minorticks_off()


def _round_times(low: float, high: float) -> list[float]:
    """Return 1, 2 and 5 times powers of ten from low to high; only powers if there would be too many."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 5), (1,)):
        ticks = [tick for power in powers for step in steps if low <= (tick := step * 10.0**power) <= high]
        if len(ticks) <= 10:
            break
    return ticks


def _scale_counts(axes: "Axes", most: int) -> None:
    """Make the horizontal axis logarithmic, from 1 to `most` switches."""
    most = max(most, 2)
    axes.set_xscale("log")
    axes.set_xlim(0.94, most * 1.08)
    doubled = [2**power for power in range(most.bit_length()) if 2**power * 1.2 < most]
    axes.set_xticks([*doubled, most], [f"{tick}" for tick in (*doubled, most)])
    axes.minorticks_off()


def _scale_rates(axes: "Axes", shown: Sequence[Rate], by: str) -> None:
    """Make the vertical axis one of rates, from the least of `shown` to the greatest, with their whiskers."""
    low = min((rate.low for rate in shown), default=0.0)
    high = max((rate.high for rate in shown), default=1.0)
    room = max(0.06 * (high - low), 0.004)
    bottom, top = axes.set_ylim(max(low - room, -0.02), high + 1.6 * room)
    ticks = [tick for tick in axes.get_yticks() if max(bottom, -1e-9) <= tick <= min(top, 1 + 1e-9)]
    axes.set_yticks(ticks, [f"{100 * tick:.3g} %" for tick in ticks])
    axes.set_ylabel(f"accuracy: trials, {by}", color=_INK)


def _draw_tried(axes: "Axes", tried: Sequence[tuple[float, Tried]]) -> None:
    """Draw the screened placements, faintly."""
    if not tried:
        return
    for inputs, colour in _COLOURS.items():
        xs = [x for x, each in tried if each.inputs == inputs]
        ys = [each.rate.mean for _, each in tried if each.inputs == inputs]
        axes.scatter(xs, ys, s=_TRIED_SIZE, marker=_SHAPES[inputs], color=colour, alpha=0.22, lw=0, zorder=1.5)
    axes.scatter([], [], s=_TRIED_SIZE, color=_GREY, alpha=0.6, lw=0, label="tried")


def _draw_trainers(axes: "Axes", tried: Sequence[tuple[float, Tried]]) -> None:
    """Draw each trainer's front, not corrected for luck."""
    for number, name in enumerate(dict.fromkeys(each.trainer for _, each in tried)):
        places = [(x, each.rate.mean) for x, each in tried if each.trainer == name]
        best = front(places, lambda place: place[0], lambda place: place[1])
        xs, ys = [*(x for x, _ in best), axes.get_xlim()[1]], [*(y for _, y in best), best[-1][1]]
        colour, dash = _TRAINERS[number % len(_TRAINERS)], _DASHES[1 + number % (len(_DASHES) - 1)]
        axes.step(xs, ys, where="post", color=colour, lw=1.1, ls=dash, zorder=2, label=f"{shorten(name)}, tried")


def _draw_best(axes: "Axes", best: Iterable[tuple[float, float]], name: str) -> None:
    """Draw the line of best points, (cost, rate) each: from each point on its rate is reached, until a better one.

    A point that is only best among those of its decision may lie below it.
    """
    corners = front(list(best), lambda place: place[0], lambda place: place[1], step=0.0)
    if not corners:
        return
    xs = [*(x for x, _ in corners), axes.get_xlim()[1]]
    ys = [*(y for _, y in corners), corners[-1][1]]
    axes.step(xs, ys, where="post", color=_INK, lw=1.6, zorder=2.5, label=name)
    axes.fill_between(xs, ys, axes.get_ylim()[0], step="post", color=_INK, alpha=0.04, lw=0, zorder=0.5)


def _draw_points(axes: "Axes", points: Sequence[tuple[float, FrontierPoint]], best: str, kept: str) -> None:
    """Draw points with intervals: those of the front `best` filled, the others hollow; all filled without a front.
    `kept` names the elements, such as "switches".
    """
    for inputs, colour in _COLOURS.items():
        some = [(x, point) for x, point in points if point.setting.inputs == inputs]
        _draw_whiskers(axes, [(x, point.rate) for x, point in some], colour)
        for x, point in some:
            y, face = point.rate.mean, _WHITE if best and best not in point.fronts else colour
            look: dict[str, Any] = {"marker": _SHAPES[inputs], "facecolor": face, "edgecolor": colour}
            axes.scatter([x], [y], s=_SIZE, lw=1.2, zorder=4, gid=f"{POINT_ID}{point.number}", **look)
        if some:
            name = _NAMES[inputs].replace("switches", kept)
            axes.scatter([], [], s=_SIZE, marker=_SHAPES[inputs], color=colour, label=name)
    if best and any(best not in point.fronts for _, point in points):
        axes.scatter([], [], s=_SIZE, facecolor=_WHITE, edgecolor=_GREY, lw=1.2, label="not the best here")


def _draw_numbers(
    axes: "Axes", points: Iterable[tuple[float, FrontierPoint]], marks: Iterable[tuple[float, ReferencePoint]]
) -> None:
    """Write the number of each point next to it, unless it would lie on the number of one before it, or on a mark."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    (width, height), unit = _NUMBER, 72 / figure.dpi
    written: list[tuple[float, float]] = []
    ends = [((x, mark.rate.low), (x, mark.rate.high)) for x, mark in marks]
    lines = [axes.transData.transform(line) * unit for line in ends]
    for x, point in points:
        right, up = axes.transData.transform((x, point.rate.mean)) * unit
        crossed = any(0 < left - right < width + 2 and low - height < up < high for (left, low), (_, high) in lines)
        if not crossed and all(abs(right - left) > width or abs(up - low) > height for left, low in written):
            written.append((right, up))
            style: dict[str, Any] = {"textcoords": "offset points", "fontsize": FONT - 1, "color": _INK, "zorder": 6}
            axes.annotate(f"{point.number}", (x, point.rate.mean), (4, 3), **style)


def _draw_whiskers(axes: "Axes", shown: Sequence[tuple[float, Rate]], colour: str) -> None:
    xs, lows, highs = [x for x, _ in shown], [rate.low for _, rate in shown], [rate.high for _, rate in shown]
    axes.vlines(xs, lows, highs, color=colour, lw=1.1, alpha=0.8, zorder=3)


def _draw_curves(axes: "Axes", curves: Sequence[Curve]) -> None:
    """Draw the curves of the methods, dashed differently."""
    colour = _COLOURS["switches"]
    for number, curve in enumerate(curves):
        pairs = [(size, rate) for size, rate in zip(curve.sizes, curve.rates, strict=True) if size >= 1]
        xs, rates = [size for size, _ in pairs], [rate for _, rate in pairs]
        means, name, dash = [rate.mean for rate in rates], shorten(curve.method), _DASHES[number % len(_DASHES)]
        axes.plot(xs, means, color=colour, lw=2.4, ls=dash, zorder=3, label=name if pairs else None)
        lows, highs = [rate.low for rate in rates], [rate.high for rate in rates]
        axes.fill_between(xs, lows, highs, color=colour, alpha=0.10, lw=0, zorder=1)
