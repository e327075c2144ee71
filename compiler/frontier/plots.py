"""A frontier's picture: accuracy against the time of a frame."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

from thenar.runtime.recipe import Inputs

from ..evaluation.rates import Rate
from ..pictures import on_paper, painting, rendered
from ..text import counted, duration, percent
from .points import Frontier, FrontierPoint, ReferencePoint, Tried, front
from .words import elements_of, featured, inputs_of, mark_name, of_time, shorten

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Dash = tuple[int, tuple[float, ...]]

FONT = 9.0
_INK, _GREY, _PALE, _WHITE, _PICKED = map(on_paper, ("ink", "soft", "line", "paper", "picked"))
# Shapes as well as colours, for the colour-blind.
_COLOURS: dict[Inputs, str] = {inputs: on_paper(inputs) for inputs in ("switches", "joints", "both")}
_SHAPES: dict[Inputs, str] = {"switches": "o", "joints": "^", "both": "s"}
_MARKS = ("X", "P", "D", "v")
_NAMES: dict[Inputs, str] = {"switches": "switches alone", "joints": "joints alone", "both": "switches and joints"}
# Dashes as well as colours distinguish trainers; their colours are others than those of inputs.
_TRAINERS = tuple(on_paper(f"baseline-{number}") for number in (1, 2, 3))
_DASHES: "tuple[Dash, ...]" = ((0, (5, 2)), (0, (1, 1.4)), (0, (6, 1.5, 1, 1.5)), (0, (9, 3)))

_WIDTH, _HEIGHT = 9.0, 7.0  # inches
_LEFT, _RIGHT, _BOTTOM, _TOP = 0.72, 0.18, 2.18, 0.72  # inches around the axes; the key is below them
_SIZE, _MARK_SIZE, _TRIED_SIZE = 34.0, 52.0, 9.0  # square points
_NUMBER = (13.0, 9.0)  # width and height of a number, in points of 1/72 inch
_LOWEST = 1.0  # microseconds: a logarithmic axis has no 0, and nothing takes less
_FRONT = "frame"  # the front whose points are filled and joined by a line


def picture(frontier: Frontier, kind: Literal["svg", "png"]) -> bytes:
    """Return the picture as a file; equal frontiers give equal bytes. Raises PictureError."""
    with painting(FONT):
        return rendered(draw(frontier), kind)


def draw(frontier: Frontier) -> "Figure":
    """Return the picture; call it inside `painting`."""
    figure, axes = _sheet(frontier)
    marks = [(max(mark.frame_us, _LOWEST), mark) for mark in frontier.marks]
    points = [(max(point.frame.us, _LOWEST), point) for point in frontier.points]
    _scale_rates(axes, [*(point.rate for _, point in points), *(mark.rate for _, mark in marks)], frontier.by)
    lowest = axes.get_ylim()[0]
    tried = [(max(each.frame_us, _LOWEST), each) for each in frontier.tried if each.rate.mean >= lowest]
    _scale_times(axes, [x for x, _ in (*marks, *tried, *points)])
    untimed = any(point.transfer.how == "unknown" for _, point in points)
    axis = of_time(frontier, "time of a frame: the glove read, the grasp classified")
    axes.set_xlabel(axis + "; reading the joints is left out" * untimed, color=_INK)

    _draw_tried(axes, tried)
    if len(frontier.trainers) > 1:
        _draw_trainers(axes, tried)
    _draw_best(axes, [(x, point.rate.mean) for x, point in points if _FRONT in point.fronts])
    _draw_points(axes, points, elements_of(frontier))
    _draw_whiskers(axes, [(x, mark.rate) for x, mark in marks], _INK)
    for number, (x, mark) in enumerate(marks):
        look: dict[str, Any] = {"marker": _MARKS[number % len(_MARKS)], "color": _INK, "edgecolor": _WHITE, "lw": 0.8}
        named = _named(shorten(mark_name(mark, frontier)), x, mark.rate)
        axes.scatter([x], [mark.rate.mean], s=_MARK_SIZE, zorder=4.5, label=named, **look)
    spoken_of = featured(frontier)
    _draw_numbers(axes, sorted(points, key=lambda place: place[1] is not spoken_of), marks)
    for x, point in points:
        if point is spoken_of:
            ring: dict[str, Any] = {"facecolor": "none", "edgecolor": _PICKED, "lw": 1.6, "zorder": 5}
            named = _named(f"point {point.number}: {inputs_of(frontier, point)}", x, point.rate)
            axes.scatter([x], [point.rate.mean], s=4.5 * _SIZE, **ring)
            axes.scatter([], [], s=2 * _SIZE, label=named, **ring)
    if axes.get_legend_handles_labels()[0]:
        place = _LEFT / _WIDTH, (_BOTTOM - 0.5) / _HEIGHT
        figure.legend(loc="upper left", bbox_to_anchor=place, ncols=2, frameon=False, labelspacing=0.35)
    return figure


def _named(name: str, us: float, rate: Rate) -> str:
    return f"{name}, {duration(us)}, {percent(rate.mean)}"


def _sheet(frontier: Frontier) -> tuple["Figure", "Axes"]:
    """Return a figure and its axes with a title, and a subtitle on data and protocol."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, _HEIGHT), dpi=144, facecolor=_WHITE)
    left, right, bottom, top = _LEFT / _WIDTH, _RIGHT / _WIDTH, _BOTTOM / _HEIGHT, _TOP / _HEIGHT
    under = (
        f"{shorten(frontier.source)}: {frontier.trials:,} trials of {counted(frontier.subjects, 'person', 'people')}, "
        f"{len(frontier.grasps)} types; "
        f"placement inside the fold, corrected for luck, 95 % intervals"
    )
    title = f"Accuracy against frame time, {shorten(frontier.machine)}"
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
        colour, dash = _TRAINERS[number % len(_TRAINERS)], _DASHES[number % len(_DASHES)]
        axes.step(xs, ys, where="post", color=colour, lw=1.1, ls=dash, zorder=2, label=f"{shorten(name)}, tried")


def _draw_best(axes: "Axes", best: Iterable[tuple[float, float]]) -> None:
    """Draw the line of best points, (cost, rate) each: from each point on its rate is reached, until a better one.

    A point that is only best among those of its decision may lie below it.
    """
    corners = front(list(best), lambda place: place[0], lambda place: place[1], step=0.0)
    if not corners:
        return
    xs = [*(x for x, _ in corners), axes.get_xlim()[1]]
    ys = [*(y for _, y in corners), corners[-1][1]]
    axes.step(xs, ys, where="post", color=_INK, lw=1.6, zorder=2.5, label="the best for its time")
    axes.fill_between(xs, ys, axes.get_ylim()[0], step="post", color=_INK, alpha=0.04, lw=0, zorder=0.5)


def _draw_points(axes: "Axes", points: Sequence[tuple[float, FrontierPoint]], kept: str) -> None:
    """Draw points with intervals: those of the front filled, the others hollow. `kept` names the elements."""
    for inputs, colour in _COLOURS.items():
        some = [(x, point) for x, point in points if point.setting.inputs == inputs]
        _draw_whiskers(axes, [(x, point.rate) for x, point in some], colour)
        for x, point in some:
            y, face = point.rate.mean, colour if _FRONT in point.fronts else _WHITE
            look: dict[str, Any] = {"marker": _SHAPES[inputs], "facecolor": face, "edgecolor": colour}
            axes.scatter([x], [y], s=_SIZE, lw=1.2, zorder=4, **look)
        if some:
            name = _NAMES[inputs].replace("switches", kept)
            axes.scatter([], [], s=_SIZE, marker=_SHAPES[inputs], color=colour, label=name)
    if any(_FRONT not in point.fronts for _, point in points):
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
