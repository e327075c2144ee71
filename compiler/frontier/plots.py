"""A frontier's picture: accuracy against the time of a frame."""

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

from thenar.runtime.recipe import Inputs

from ..evaluation.rates import Rate, interval
from ..pictures import FONT, WIDTH, Box, around, on_paper, painting, rendered, write_beside
from ..text import counted, duration
from .points import Frontier, front
from .words import elements_of, featured, inputs_of, of_time, shorten

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK, _GREY, _PALE, _WHITE, _PICKED = map(on_paper, ("ink", "soft", "line", "paper", "picked"))
# Shapes as well as colours, for the colour-blind.
_COLOURS: dict[Inputs, str] = {inputs: on_paper(inputs) for inputs in ("switches", "joints", "both")}
_SHAPES: dict[Inputs, str] = {"switches": "o", "joints": "^", "both": "s"}
_NAMES: dict[Inputs, str] = {"switches": "switches", "joints": "joints", "both": "both"}

_HEIGHT = 6.2  # inches
_LEFT, _RIGHT, _BOTTOM, _TOP = 0.9, 0.1, 1.2, 1.15  # inches around the axes; the key is below them
_LETTERS = 62  # of a line
_SIZE, _TRIED_SIZE = 46.0, 9.0  # square points
_APART = 9.0  # points between markers with intervals
_LOWEST = 1.0  # microseconds: a logarithmic axis has no 0, and nothing takes less
_FRONT = "frame"  # the front whose points are filled and joined by a line


def picture(frontier: Frontier, kind: Literal["svg", "png"]) -> bytes:
    """Return the picture as a file; equal frontiers give equal bytes. Raises PictureError."""
    with painting(FONT):
        return rendered(draw(frontier), kind)


def draw(frontier: Frontier) -> "Figure":
    """Return the picture; call it inside `painting`.

    Of points and marks of nearly the same time, those on the right are moved a little, to keep them apart. The points
    of the front have intervals; those of the others, and of marks, are in tables.
    """
    figure, axes = _sheet(frontier)
    spoken_of = featured(frontier)
    marks = [(max(mark.frame_us, _LOWEST), mark) for mark in frontier.marks]
    points = [(max(point.frame.us, _LOWEST), point) for point in frontier.points]
    best = [(x, point.rate) for x, point in points if _FRONT in point.fronts or point is spoken_of]
    apart = best + [(x, mark.rate) for x, mark in marks]
    means = [*(mark.rate.mean for mark in frontier.marks), *(point.rate.mean for point in frontier.points)]
    _scale_rates(axes, [(rate.low, rate.high) for _, rate in best] + [(mean, mean) for mean in means], frontier.by)
    lowest = axes.get_ylim()[0]
    tried = [(max(each.frame_us, _LOWEST), each) for each in frontier.tried if each.rate.mean >= lowest]
    _scale_times(axes, [x for x, _ in (*marks, *tried, *points)])
    untimed = any(point.transfer.how == "unknown" for point in frontier.points)
    axis = of_time(frontier, "time of a frame: the glove read, the grasp classified")
    axes.set_xlabel(textwrap.fill(axis + "; reading the joints is left out" * untimed, _LETTERS), color=_INK)
    moved = _apart(axes, [x for x, _ in apart])
    places = dict(zip(((x, id(rate)) for x, rate in apart), moved, strict=True))

    for inputs, colour in _COLOURS.items() if tried else ():
        xs = [x for x, each in tried if each.inputs == inputs]
        ys = [each.rate.mean for _, each in tried if each.inputs == inputs]
        axes.scatter(xs, ys, s=_TRIED_SIZE, marker=_SHAPES[inputs], color=colour, alpha=0.22, lw=0, zorder=1.5)
    if tried:
        axes.scatter([], [], s=2 * _TRIED_SIZE, color=_GREY, alpha=0.6, lw=0, label="tried")
    lines, labels = _draw_best(axes, [(x, point.rate.mean) for x, point in points if _FRONT in point.fronts]), []
    for inputs, colour in _COLOURS.items():
        mine = [(x, point) for x, point in points if point.setting.inputs == inputs]
        for x, point in mine:
            at, filled = places.get((x, id(point.rate)), x), _FRONT in point.fronts
            look: dict[str, Any] = {"marker": _SHAPES[inputs], "edgecolor": colour, "lw": 1.2, "zorder": 4}
            axes.scatter([at], [point.rate.mean], s=_SIZE, facecolor=colour if filled else _WHITE, **look)
            labels.append((point is not spoken_of, not filled, (at, point.rate.mean, str(point.number))))
            if (x, id(point.rate)) in places:
                lines.append(_draw_interval(axes, at, point.rate, colour))
        if mine:
            name = _NAMES[inputs].replace("switches", elements_of(frontier))
            axes.scatter([], [], s=_SIZE, marker=_SHAPES[inputs], color=colour, label=name)
    for x, mark in marks:
        at = places[x, id(mark.rate)]
        axes.scatter([at], [mark.rate.mean], s=_SIZE, marker="D", color=_INK, edgecolor=_WHITE, lw=0.8, zorder=4.5)
        labels.append((True, False, (at, mark.rate.mean, shorten(mark.name))))
    if spoken_of is not None:
        ring: dict[str, Any] = {"facecolor": "none", "edgecolor": _PICKED, "lw": 1.8, "zorder": 5}
        at = places[max(spoken_of.frame.us, _LOWEST), id(spoken_of.rate)]
        axes.scatter([at], [spoken_of.rate.mean], s=4.5 * _SIZE, **ring)
    labels.sort(key=lambda label: label[:2])
    spots = [label for *_, label in labels]
    write_beside(axes, spots, [around(axes, x, y) for x, y, _ in spots], lines)
    if axes.get_legend_handles_labels()[0]:
        place = _LEFT / WIDTH, (_BOTTOM - 0.6) / _HEIGHT
        figure.legend(
            loc="upper left", bbox_to_anchor=place, ncols=3, frameon=False, columnspacing=1, handletextpad=0.3
        )
    return figure


def _sheet(frontier: Frontier) -> tuple["Figure", "Axes"]:
    """Return a figure and its axes with a title, and what is shown below it: data, and the ringed point."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, _HEIGHT), dpi=144, facecolor=_WHITE)
    left, right, bottom, top = _LEFT / WIDTH, _RIGHT / WIDTH, _BOTTOM / _HEIGHT, _TOP / _HEIGHT
    under = [
        f"{shorten(frontier.source)}, {shorten(frontier.machine)}: {frontier.trials:,} trials of "
        f"{counted(frontier.subjects, 'person', 'people')}, {len(frontier.grasps)} types"
    ]
    if (point := featured(frontier)) is not None:
        rate = f"{interval(point.rate)} % in {duration(point.frame.us)}"
        under.append(f"Ringed: point {point.number}, {inputs_of(frontier, point)}, {rate}")
    title = "Accuracy against frame time, with 95 % intervals"
    figure.text(0.02, 1 - 0.26 / _HEIGHT, title, fontsize=13, fontweight="bold", color=_INK)
    lines = [line for words in under for line in textwrap.wrap(words, _LETTERS)]
    figure.text(0.02, 1 - 0.34 / _HEIGHT, "\n".join(lines[:4]), color=_GREY, va="top", linespacing=1.1)
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
    """Return 1, 2 and 5 times powers of ten from low to high; only powers if there would be too many. A range without
    any has its middle.
    """
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 5), (1,)):
        ticks = [tick for power in powers for step in steps if low <= (tick := step * 10.0**power) <= high]
        if len(ticks) <= 5:
            break
    return ticks[:: -(-len(ticks) // 5)] if ticks else [math.sqrt(low * high)]


def _scale_rates(axes: "Axes", shown: Sequence[tuple[float, float]], by: str) -> None:
    """Make the vertical axis one of rates, from the least end of the intervals `shown` to the greatest."""
    low = min((low for low, _ in shown), default=0.0)
    high = max((high for _, high in shown), default=1.0)
    room = max(0.06 * (high - low), 0.004)
    bottom, top = axes.set_ylim(max(low - room, -0.02), high + 1.6 * room)
    ticks = [tick for tick in axes.get_yticks() if max(bottom, -1e-9) <= tick <= min(top, 1 + 1e-9)]
    axes.set_yticks(ticks, [f"{100 * tick:.3g} %" for tick in ticks])
    axes.set_ylabel(f"accuracy: trials, {by}", color=_INK)


def _apart(axes: "Axes", xs: Sequence[float]) -> list[float]:
    """Return times in the order of `xs`, moved to the right, or from the edge to the left, until all are apart."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    least = _APART * figure.dpi / 72
    order = sorted(range(len(xs)), key=xs.__getitem__)
    places = [float(axes.transData.transform((xs[number], 0))[0]) for number in order]
    edge = axes.transAxes.transform((1, 0))[0] - least / 2
    for number in range(1, len(places)):
        places[number] = max(places[number], places[number - 1] + least)
    for number in reversed(range(len(places))):
        places[number] = min(places[number], edge - (len(places) - 1 - number) * least)
    inverse, moved = axes.transData.inverted(), dict(zip(order, places, strict=True))
    return [float(inverse.transform((moved[number], 0))[0]) for number in range(len(xs))]


def _draw_best(axes: "Axes", best: Iterable[tuple[float, float]]) -> list[Box]:
    """Draw the line of best points, (cost, rate) each: from each point on its rate is reached, until a better one.
    Return the boxes of its level parts, in pixels.

    A point that is only best among those of its decision may lie below it.
    """
    corners = front(list(best), lambda place: place[0], lambda place: place[1], step=0.0)
    if not corners:
        return []
    xs = [*(x for x, _ in corners), axes.get_xlim()[1]]
    ys = [*(y for _, y in corners), corners[-1][1]]
    axes.step(xs, ys, where="post", color=_INK, lw=1.6, zorder=2.5, label="the best for its time")
    levels = (
        axes.transData.transform([(x, y), (end, y)]).ravel().tolist() for x, end, y in zip(xs, xs[1:], ys, strict=False)
    )
    return [(left, bottom - 1, right, top + 1) for left, bottom, right, top in levels]


def _draw_interval(axes: "Axes", x: float, rate: Rate, colour: str) -> Box:
    """Draw an interval, and return its box, in pixels."""
    axes.vlines([x], [rate.low], [rate.high], color=colour, lw=1.4, alpha=0.8, zorder=3)
    (left, bottom), (right, top) = axes.transData.transform([(x, rate.low), (x, rate.high)]).tolist()
    return left - 1, bottom, right + 1, top
