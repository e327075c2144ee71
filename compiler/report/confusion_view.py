"""Confusion matrices as tables: counts, each shaded by its share of its row."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..evaluation.study import Study
from ..text import NBSP, percent

# Wider tables cannot be read; the list of what is mistaken most often can.
WIDEST = 40
_MOST = 5
_SHADES = 9

Counts = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class CountCell:
    """A count, and the class that shades it: hit or miss, from 1 to 9; "" for none."""

    count: str
    shade: str


@dataclass(frozen=True, slots=True)
class ConfusionRow:
    """A true grasp type: its cells, how many rows it has, and the share of them that was recognised."""

    grasp: str
    cells: tuple[CountCell, ...]
    total: str
    recognised: str


@dataclass(frozen=True, slots=True)
class ConfusionView:
    """A matrix: where it is from, its columns, its rows (none where too wide), and what is mistaken most."""

    title: str
    grasps: tuple[str, ...]
    rows: tuple[ConfusionRow, ...]
    mistaken: tuple[str, ...]


def confusion_view(title: str, grasps: Sequence[str], counts: Counts) -> ConfusionView:
    """Return the table of `counts` (K, K), row: true, column: recognised."""
    rows = tuple(_row(grasp, number, line) for number, (grasp, line) in enumerate(zip(grasps, counts, strict=True)))
    return ConfusionView(title, tuple(grasps), rows if len(grasps) <= WIDEST else (), tuple(_mistaken(grasps, counts)))


def study_confusions(study: Study) -> tuple[ConfusionView, ...]:
    """Return the matrices of the compositions under the honest protocol, all subjects together."""
    return tuple(
        confusion_view(f"{row.name}: {row.what}, honest folds of {_subjects(table.columns)}", study.grasps, total)
        for table in study.tables
        if table.name == "compositions" and table.protocol == "honest"
        for row in table.rows
        for total in [np.sum([cell.confusion for cell in row.cells if cell.confusion is not None], axis=0)]
        if np.ndim(total) == 2
    )


def _subjects(columns: Sequence[str]) -> str:
    return f"subject {columns[0]}" if len(columns) == 1 else f"{len(columns)} subjects together"


def _row(grasp: str, number: int, counts: Counts) -> ConfusionRow:
    total = int(counts.sum())
    cells = tuple(_cell(count, total, column == number) for column, count in enumerate(counts.tolist()))
    return ConfusionRow(grasp, cells, f"{total:,}", percent(counts[number] / total, NBSP) if total else "")


def _cell(count: int, total: int, hit: bool) -> CountCell:
    if not count:
        return CountCell("·", "")
    return CountCell(f"{count:,}", f"{'hit' if hit else 'miss'}{1 + (_SHADES - 1) * count // total}")


def _mistaken(grasps: Sequence[str], counts: Counts) -> Iterator[str]:
    """Yield sentences on the commonest mistakes; of equally common ones the first in the table."""
    wrong = counts.copy()
    np.fill_diagonal(wrong, 0)
    for place in np.argsort(-wrong, axis=None, kind="stable")[:_MOST].tolist():
        true, found = divmod(place, len(grasps))
        if wrong[true, found]:
            total = int(counts[true].sum())
            yield f"{grasps[true]} taken for {grasps[found]}: {wrong[true, found]:,} of {total:,} rows"
