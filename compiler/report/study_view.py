"""The paper's tables as tables of the page."""

from dataclasses import dataclass

from ..evaluation.plan import TableName
from ..evaluation.populations import PROTOCOLS
from ..evaluation.study import Cell, Row, Spread, Study, Table
from ..text import NBSP, counted, interval, sentence

_TITLES: dict[TableName, str] = {
    "compositions": "Compositions of inputs (the paper's Tables II and V)",
    "generality": "One subject's placement (row) on another's data (column), selected switches (Tables III and VI)",
    "pruning": "Placement of all subjects pooled, pruned by S, selected switches (Tables IV and VII)",
    "baselines": "ID3 beside other placements of as many switches, selected switches",
}


@dataclass(frozen=True, slots=True)
class RateRow:
    """A row: its name, what it is, its switches, and its rates in percent, each with what there is to add to it."""

    name: str
    what: str
    switches: str
    rates: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class RateTable:
    """A table: its caption, the heads of its columns of rates, its rows; blind: whether a star needs a word."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[RateRow, ...]
    blind: bool


@dataclass(frozen=True, slots=True)
class StudyView:
    """The tables, and sentences before and after them."""

    protocols: tuple[tuple[str, str], ...]
    tables: tuple[RateTable, ...]
    notes: tuple[str, ...]


def study_view(study: Study) -> StudyView:
    """Return the tables of `study` with what there is to say of them."""
    asked = tuple((each.name, each.meaning) for each in PROTOCOLS if each.name in study.options.protocols)
    missing = tuple(f"No table of {left.name}: {left.reason}." for left in study.left_out)
    warnings = tuple(map(sentence, study.warnings))
    return StudyView(asked, tuple(map(_table, study.tables)), (_cut(study), *warnings, *missing))


def _cut(study: Study) -> str:
    options = study.options
    repeats = counted(options.repeats, "repeat")
    cut = {
        "stratified": f"{options.folds} stratified folds, {repeats} from seed {options.seed}",
        "subject": "one subject left out at a time, all others trained on",
        "object": "one object left out at a time",
        "block": f"{options.folds} blocks of trials",
    }[options.scheme]
    grasps = counted(len(study.grasps), "grasp type")
    return f"{study.rows:,} rows, {grasps}; {cut}; {options.rounds} rounds; rates in % with 95{NBSP}% intervals."


def _table(table: Table) -> RateTable:
    several = len(table.columns) > 1
    rows = tuple(_row(row, several) for row in table.rows)
    return RateTable(
        caption=f"{_TITLES[table.name]}: {table.protocol} protocol",
        columns=(*table.columns, "average") if several else table.columns,
        rows=rows,
        blind=any(cell.no_inputs for row in table.rows for cell in row.cells),
    )


def _row(row: Row, several: bool) -> RateRow:
    average = ((interval(row.average), ""),) if several else ()
    return RateRow(row.name, row.what, _spread(row.switches), (*map(_cell, row.cells), *average))


def _cell(cell: Cell) -> tuple[str, str]:
    draws = "" if cell.draws is None else f"from {100 * cell.draws.least:.1f} to {100 * cell.draws.most:.1f}"
    return interval(cell.rate) + ("*" if cell.no_inputs else ""), draws


def _spread(spread: Spread) -> str:
    return f"{spread.least:g}" if spread.least == spread.most else f"{spread.least:g} to {spread.most:g}"
