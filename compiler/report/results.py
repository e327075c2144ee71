"""The sections on accuracy: the paper's tables, and the confusion matrices."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..evaluation.folds import PROTOCOLS
from ..evaluation.study import Study
from ..evaluation.tables import RateTable, both
from ..movements.transitions import Transitions
from ..text import NBSP, counted, percent, sentence
from .content import PlainTable, ReportContent
from .sections import recipe

# Wider tables are illegible; the list of the most frequent mistakes is not.
WIDEST = 40
_MOST = 5
_SHADES = 9


def protocols(study: Study) -> tuple[tuple[str, str], ...]:
    """Return the study's protocols and their meanings."""
    return tuple((f"{each.name} protocol", each.meaning) for each in PROTOCOLS if each.name in study.options.protocols)


def study_tables(study: Study) -> tuple[PlainTable, ...]:
    """Return the paper's tables."""
    return tuple(map(_table, study.tables))


def study_notes(study: Study) -> Iterator[str]:
    """Yield how the rows were split, the caveats, and the missing tables with the reasons."""
    yield sentence(str(study))
    yield from map(sentence, study.warnings)
    for left in study.left_out:
        yield f"No table of {left.name}: {left.reason}."


def _table(table: RateTable) -> PlainTable:
    several = len(table.columns) > 1
    columns = ("Row", "What", "Elements", *table.columns, *(["all"] * several))
    rows = tuple(
        (row.name, row.what, str(row.switches), *map(str, row.cells), *([both(row.rate, row.frames)] * several))
        for row in table.rows
    )
    return PlainTable(table.title, columns, rows, words=(0, 1), note=table.note)


def transition_table(found: Transitions) -> PlainTable:
    """Return the changes from type to type, the most frequent first."""
    counts, shares = found.counts, found.probabilities
    changes = sorted(np.argwhere(counts).tolist(), key=lambda each: (-counts[tuple(each)], each))
    rows = tuple(
        (found.types[a], found.types[b], str(counts[a, b]), percent(float(shares[a, b]), NBSP)) for a, b in changes
    )
    return PlainTable("Changes of grasp type", ("From", "To", "Count", "Of its changes"), rows, words=(0, 1))


@dataclass(frozen=True, slots=True)
class ConfusionView:
    """Counts as a table: their source, the grasp types, a row for each of these, and the most frequent mistakes.

    rows  grasp type; its counts, each with its shading class ("hit1" to "miss9", "" for none); its number of rows; the
          share of them predicted correctly. Empty where the table would be too wide.
    """

    title: str
    grasps: tuple[str, ...]
    rows: tuple[tuple[str, tuple[tuple[str, str], ...], str, str], ...]
    mistaken: tuple[str, ...]


def confusion_view(title: str, grasps: Sequence[str], counts: NDArray[np.intp]) -> ConfusionView:
    """Return the table of `counts` (K, K), row: true, column: predicted; a shade is a share of its row."""
    rows = []
    for number, (grasp, line) in enumerate(zip(grasps, counts.tolist(), strict=True)):
        total = sum(line)
        cells = tuple(_shaded(count, total, column == number) for column, count in enumerate(line))
        rows.append((grasp, cells, f"{total:,}", percent(line[number] / total, NBSP) if total else ""))
    shown = tuple(rows) if len(grasps) <= WIDEST else ()
    return ConfusionView(title, tuple(grasps), shown, tuple(_mistaken(grasps, counts)))


def confusions(content: ReportContent) -> Iterator[ConfusionView]:
    """Yield the build's own matrix, then those of the compositions, nested folds, all subjects together."""
    if content.confusion is not None:
        rate = content.manifest.headline
        folds = "" if rate is None else f", {rate.title}, {counted(rate.folds, 'nested fold')}"
        title = f"This build's recipe ({recipe(content.manifest)}){folds}"
        yield confusion_view(title, content.manifest.classes[: len(content.confusion)], content.confusion)
    if content.study is None:
        return
    for table in content.study.tables:
        if (table.name, table.protocol) == ("compositions", "nested"):
            one = len(table.columns) == 1
            whose = f"subject {table.columns[0]}" if one else f"{len(table.columns)} subjects together"
            for row in table.rows:
                counts = [cell.confusion for cell in row.cells if cell.confusion is not None]
                if counts:
                    title = f"{row.name}: {row.what}, nested folds of {whose} ({table.recipe})"
                    yield confusion_view(title, content.study.grasps, np.sum(counts, axis=0))


def _shaded(count: int, total: int, hit: bool) -> tuple[str, str]:
    if not count:
        return "·", ""
    return f"{count:,}", f"{'hit' if hit else 'miss'}{1 + (_SHADES - 1) * count // total}"


def _mistaken(grasps: Sequence[str], counts: NDArray[np.intp]) -> Iterator[str]:
    """Yield sentences on the most frequent mistakes; ties are in the order of the table."""
    wrong = counts.copy()
    np.fill_diagonal(wrong, 0)
    for place in np.argsort(-wrong, axis=None, kind="stable")[:_MOST].tolist():
        true, found = divmod(place, len(grasps))
        if wrong[true, found]:
            total = int(counts[true].sum())
            yield f"{grasps[true]} mistaken for {grasps[found]}: {wrong[true, found]:,} of {total:,} rows"
