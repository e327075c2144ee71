"""Confusion matrices and learning curves as pictures."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thenar.runtime.files import write_atomically

from ..pictures import on_paper, painting, rendered
from .learning import ExpectedAccuracy, Learning
from .study import Study
from .tables import RateRow, RateTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .rates import Rate
    from .tables import Confusion


# Curves are not inputs, so they get other colours.
_CURVES = ("ink", "picked", "link", "baseline-1", "baseline-2", "baseline-3")
LEARNING_NAME = "learning-curve.svg"


def draw(study: Study, folder: Path) -> list[Path]:
    """Write a picture for each composition and protocol, subjects side by side, and one of learning curves, if present.

    Return the files: `confusion-PROTOCOL-COMPOSITION.png` and LEARNING_NAME in `folder`, which is created if necessary.
    Colour is the share of the true grasp type's rows; numbers are percent of them, omitted below 1 %. Raises OSError
    from the system.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with painting(font_size=10):
        curves = [] if study.learning is None else [_draw_learning(study.learning, folder / LEARNING_NAME)]
        return curves + [
            _draw(study.grasps, table, row, folder / f"confusion-{table.protocol}-{row.name}.png")
            for table in study.tables
            if table.name == "compositions"
            for row in table.rows
        ]


def _draw(grasps: tuple[str, ...], table: RateTable, row: RateRow, path: Path) -> Path:
    from matplotlib.figure import Figure

    side = 1.6 + 0.42 * len(grasps)
    figure = Figure(figsize=(side * len(row.cells) + 0.6, side + 0.4), layout="constrained", dpi=120)
    figure.suptitle(f"{row.name}: {row.what} ({table.protocol} protocol, {row.rate.what})")
    all_axes = figure.subplots(1, len(row.cells), squeeze=False)[0]
    for axes, name, cell in zip(all_axes, table.columns, row.cells, strict=True):
        if cell.confusion is not None:
            draw_matrix(axes, grasps, cell.confusion)
        axes.set_title(f"subject {name}: {100 * cell.rate.mean:.1f} %", fontsize=10)
    all_axes[0].set_ylabel("true")
    write_atomically(path, rendered(figure, "png"))
    return path


def _draw_learning(learning: Learning, path: Path) -> Path:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.4), layout="constrained", dpi=120)
    axes = figure.subplots()
    axes.set_xscale("log")
    for number, curve in enumerate(learning.curves):
        colour, last = on_paper(_CURVES[number % len(_CURVES)]), learning.repetitions[-1]
        # Shift curves sideways so that whiskers do not hide each other.
        shift = 1 + 0.025 * (number - (len(learning.curves) - 1) / 2)
        xs, means = [shift * n for n in learning.repetitions], [100 * rate.mean for rate in curve.rates]
        reach = [[100 * (r.mean - r.low) for r in curve.rates], [100 * (r.high - r.mean) for r in curve.rates]]
        axes.errorbar(xs, means, reach, color=colour, marker="os^Dv"[number % 5], ms=4, lw=1.5, elinewidth=0.8)
        axes.plot([], [], color=colour, marker="os^Dv"[number % 5], ms=4, label=curve.learner)
        if curve.expected:
            ahead = [last, *(each.repetitions for each in curve.expected)]
            shown: list[Rate | ExpectedAccuracy] = [curve.rates[-1], *curve.expected]
            lows, highs = [100 * each.low for each in shown], [100 * each.high for each in shown]
            axes.plot(ahead, [100 * each.mean for each in shown], color=colour, lw=1.5, ls=(0, (2, 2)))
            axes.fill_between(ahead, lows, highs, color=colour, alpha=0.08, lw=0)
    if learning.further:
        axes.plot([], [], color=on_paper("soft"), ls=(0, (2, 2)), label="expected, 95 % shaded")
    ticks = [*learning.repetitions, *learning.further]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.set_xlabel("repetitions of each grasp type by each person that were trained on")
    axes.set_ylabel(f"accuracy in %: {learning.of}, trials")
    axes.set_title(f"Learning curves, {learning.inputs}", fontsize=11)
    axes.grid(color=on_paper("line"), lw=0.6)
    axes.legend(loc="lower right")
    write_atomically(path, rendered(figure, "svg"))
    return path


def draw_matrix(axes: "Axes", grasps: tuple[str, ...], confusion: "Confusion") -> None:
    """Draw one matrix of counts into `axes`, as shares of its rows."""
    counts = np.array(confusion, dtype=np.float64)
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1)
    axes.set_xticks(range(len(grasps)), grasps, rotation=90, fontsize=8)
    axes.set_yticks(range(len(grasps)), grasps, fontsize=8)
    axes.set_xlabel("recognised as")
    for true, found in np.argwhere(shares >= 0.01):
        share = shares[true, found]
        colour = "white" if share > 0.6 else "black"
        axes.text(found, true, f"{100 * share:.0f}", ha="center", va="center", fontsize=7, color=colour)
