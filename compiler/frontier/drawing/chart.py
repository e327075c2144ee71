"""A sheet for the frontier's pictures: title, axes in percent and in times that people read, a key, colours."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from thenar.runtime.manifest import Inputs

from ...text import counted, duration
from ..points import Frontier, Rate
from .words import shorten

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FONT = 9.0
INK, GREY, PALE = "#1a1a1a", "#5f5f5f", "#e3e3e3"

# Okabe and Ito's colours, which the colour-blind tell apart too, and shapes for who sees no colours.
COLOURS: dict[Inputs, str] = {"switches": "#0072B2", "joints": "#009E73", "both": "#D55E00"}
SHAPES: dict[Inputs, str] = {"switches": "o", "joints": "^", "both": "s"}
NAMES: dict[Inputs, str] = {"switches": "switches alone", "joints": "joints alone", "both": "switches and joints"}

_WIDTH, _HEIGHT = 9.0, 5.4  # inches
_LEFT, _RIGHT, _BOTTOM, _TOP = 0.72, 0.18, 0.58, 1.02  # inches around the axes
_LOWEST_US = 1e-3  # a logarithmic axis has no 0


def sheet(frontier: Frontier, title: str) -> tuple["Figure", "Axes"]:
    """Return a figure and its axes with a title, and under it what was recognised, and how that was found."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, _HEIGHT), dpi=144, facecolor="white")
    left, right, bottom, top = _LEFT / _WIDTH, _RIGHT / _WIDTH, _BOTTOM / _HEIGHT, _TOP / _HEIGHT
    figure.text(left, 1 - 0.30 / _HEIGHT, title, fontsize=13, fontweight="bold", color=INK)
    figure.text(left, 1 - 0.53 / _HEIGHT, _under(frontier), fontsize=FONT, color=GREY)
    axes = figure.add_axes((left, bottom, 1 - left - right, 1 - bottom - top))
    axes.set_axisbelow(True)
    axes.grid(color=PALE, lw=0.6)
    axes.spines[["left", "bottom"]].set_color(GREY)
    axes.tick_params(colors=GREY, labelcolor=INK)
    return figure, axes


def _under(frontier: Frontier) -> str:
    return (
        f"{shorten(frontier.source)}: {frontier.rows:,} grasps of {counted(frontier.subjects, 'person', 'people')}, "
        f"{len(frontier.grasps)} types; {frontier.target}; "
        f"{frontier.folds} folds x {frontier.repeats}, placement inside the fold, 95 % intervals"
    )


def times(axes: "Axes", us: Iterable[float], what: str) -> None:
    """Make the horizontal axis logarithmic, in times, so that all of `us` stand on it with room to spare."""
    known = [max(each, _LOWEST_US) for each in us] or [100.0, 1000.0]
    low, high = min(known), max(known)
    room = max(1.15, (high / low) ** 0.07)
    axes.set_xscale("log")
    axes.set_xlim(low / room, high * room)
    within = _round_times(low / room, high * room)
    axes.set_xticks(within, [duration(tick) for tick in within])
    axes.minorticks_off()
    axes.set_xlabel(what, color=INK)


def _round_times(low: float, high: float) -> list[float]:
    """Return 1, 2 and 5 times powers of ten from low to high; powers alone where there would be too many."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 5), (1,)):
        ticks = [tick for power in powers for step in steps if low <= (tick := step * 10.0**power) <= high]
        if len(ticks) <= 10:
            break
    return ticks


def rates(axes: "Axes", shown: Sequence[Rate]) -> None:
    """Make the vertical axis one of rates, from the least of `shown` to the greatest, whiskers and all."""
    low = min((rate.low for rate in shown), default=0.0)
    high = max((rate.high for rate in shown), default=1.0)
    room = max(0.06 * (high - low), 0.004)
    bottom, top = axes.set_ylim(max(low - room, -0.02), high + 1.6 * room)
    ticks = [tick for tick in axes.get_yticks() if max(bottom, -1e-9) <= tick <= min(top, 1 + 1e-9)]
    axes.set_yticks(ticks, [f"{100 * tick:.3g} %" for tick in ticks])
    axes.set_ylabel("grasps recognised", color=INK)


def counts(axes: "Axes", most: int) -> None:
    """Make the horizontal axis logarithmic, one of 1 to `most` switches."""
    most = max(most, 2)
    axes.set_xscale("log")
    axes.set_xlim(0.94, most * 1.08)
    doubled = [2**power for power in range(most.bit_length()) if 2**power * 1.2 < most]
    axes.set_xticks([*doubled, most], [f"{tick}" for tick in (*doubled, most)])
    axes.minorticks_off()
    axes.set_xlabel("switches kept", color=INK)


def key(axes: "Axes") -> None:
    """Say over the axes what its shapes and lines mean: all that has a label of its own."""
    if not axes.get_legend_handles_labels()[0]:
        return
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(-0.012, 0.995),
        ncols=6,
        frameon=False,
        fontsize=FONT,
        handletextpad=0.35,
        columnspacing=1.4,
        handlelength=1.3,
    )
