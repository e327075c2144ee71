"""Confusion matrices as pictures."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thenar.runtime.files import write_atomically

from ..pictures import painting, rendered
from .study import Study
from .tables import RateTable, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .tables import Confusion


def draw_confusions(study: Study, folder: Path) -> list[Path]:
    """Write a picture for each composition and protocol, subjects side by side; return the files.

    They are `confusion-PROTOCOL-COMPOSITION.png` in `folder`, which is made if need be. Colour is the share of the true
    grasp type's rows; numbers are percent of them, left out below 1 %. Raises OSError as the system gives it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with painting(font_size=10):
        return [
            _draw(study.grasps, table, row, folder / f"confusion-{table.protocol}-{row.name}.png")
            for table in study.tables
            if table.name == "compositions"
            for row in table.rows
        ]


def _draw(grasps: tuple[str, ...], table: RateTable, row: Row, path: Path) -> Path:
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
