"""Axes as people read them: powers of ten, rounds, a rule and what it means."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FONT = 9.5

# Okabe and Ito's colours, which the colour-blind tell apart too.
BLUE, ORANGE, RED, GREEN, GREY = "#0072B2", "#E69F00", "#D55E00", "#009E73", "#666666"

_WIDTH = 8.6  # inches
_APART = 1.03  # of two rounds on a logarithmic axis, as a ratio
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def sheet(rows: int, columns: int, height: float) -> tuple["Figure", list[list["Axes"]]]:
    """Return a figure of rows x columns axes, `height` inches high."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, height), layout="constrained", dpi=120)
    return figure, [list(row) for row in figure.subplots(rows, columns, squeeze=False)]


def head(axes: "Axes", title: str) -> None:
    """Say over the axes what they show, and in which unit."""
    axes.set_title(title, fontsize=FONT, loc="left")


def band(axes: "Axes", least: Sequence[float], greatest: Sequence[float], colour: str) -> None:
    """Draw what lies between two curves."""
    rounds, low = curve(axes, least, colour, pick=min)
    _, high = curve(axes, greatest, colour)
    axes.fill_between(rounds, low, high, color=colour, alpha=0.15, lw=0)


def curve(
    axes: "Axes",
    heights: Sequence[float],
    colour: str,
    label: str | None = None,
    pick: Callable[[Sequence[float]], float] = max,
) -> tuple[list[int], list[float]]:
    """Draw those heights after each round that are above 0, and return rounds and heights drawn.

    Rounds too near to be told apart on a logarithmic axis are one point, the height that `pick` chooses.
    """
    last, rounds = len(heights), [1]
    while rounds[-1] <= last:
        rounds.append(max(rounds[-1] + 1, int(rounds[-1] * _APART)))
    near = ([h for h in heights[first - 1 : after - 1] if h > 0] for first, after in itertools.pairwise(rounds))
    shown = [pick(some) if some else math.nan for some in near]
    axes.plot(rounds[:-1], shown, color=colour, lw=1.6, label=label)
    ticks = [10**power for power in range(len(str(last)))]
    axes.set(xscale="log", xlim=(1, last))
    axes.set_xticks(ticks, [f"{tick:,}" for tick in ticks])
    return rounds[:-1], shown


def exponents(axes: "Axes") -> range:
    """Return the exponents of at most seven powers of ten between which all that is drawn above 0 lies."""
    heights = [height for line in axes.lines for height in np.asarray(line.get_ydata(), np.float64).tolist()]
    parts = [f"{height:e}".split("e") for height in heights if height > 0] or [["1", "0"]]
    low = min(int(power) for _, power in parts)
    high = max(int(power) + (float(digits) > 1) for digits, power in parts)
    step = max(1, math.ceil((high - low) / 6))
    return range(high - step * max(1, math.ceil((high - low) / step)), high + 1, step)


def powers(axes: "Axes", ticks: range) -> None:
    """Make the vertical axis logarithmic, between powers of ten with these exponents."""
    axes.set_yscale("log")
    labels = ["1" if exponent == 0 else "10" + str(exponent).translate(_RAISED) for exponent in ticks]
    axes.set_yticks([10.0**exponent for exponent in ticks], labels)
    axes.set_ylim(10.0 ** ticks[0], 10.0 ** ticks[-1])
    axes.minorticks_off()
    axes.grid(axis="y", color="#dddddd", lw=0.6)
    axes.set_axisbelow(True)


def rule(axes: "Axes", height: float, right: float, text: str) -> None:
    """Draw a dotted line across, with what it means under its right end."""
    axes.axhline(height, color=GREY, lw=1, ls=":")
    note = axes.annotate(text, (right, height), (0, -3), textcoords="offset points", ha="right", va="top", color=GREY)
    note.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 1})
