"""The tables of `thenar evaluate` on the terminal, laid out as in the paper."""

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from thenar.compiler.evaluation.populations import PROTOCOLS
from thenar.compiler.evaluation.study import Cell, Spread, Study, Table
from thenar.compiler.text import interval

from .common import out

_TITLES = {
    "compositions": "Compositions of inputs (the paper's Tables II and V)",
    "generality": "One subject's placement (row) on another's data (column), Sel-Co (Tables III and VI)",
    "pruning": "Placement of all subjects pooled, pruned by S, Sel-Co (Tables IV and VII)",
    "baselines": "ID3 beside other placements of as many switches, Sel-Co",
}
_NO_INPUTS = "*"


def print_study(study: Study, *, confusion: bool) -> None:
    """Print all tables, and the confusion matrices if asked for."""
    console = out()
    for protocol in PROTOCOLS:
        if protocol.name in study.options.protocols:
            console.print(f"Protocol {protocol.name}: {protocol.meaning}")
    for table in study.tables:
        console.print()
        console.print(Text(f"{_TITLES[table.name]}: {table.protocol} protocol", "bold"))
        console.print(_grid(table))
        if any(cell.no_inputs for row in table.rows for cell in row.cells):
            console.print(
                f"{_NO_INPUTS} in some folds no input varied: there, the most frequent grasp type is answered"
            )
    console.print()
    for missing in study.left_out:
        console.print(f"no table of {missing.name}: {missing.reason}")
    console.print(_footing(study))
    if confusion:
        _print_confusions(console, study)


def _footing(study: Study) -> str:
    options = study.options
    cut = {
        "stratified": f"{options.folds} stratified folds, {options.repeats} repeat(s) from seed {options.seed}",
        "subject": "one subject left out at a time (the column), all others trained on",
        "object": "one object left out at a time",
        "block": f"{options.folds} blocks of trials",
    }[options.scheme]
    return f"{study.rows} rows, {len(study.grasps)} grasp types; {cut}; rates in %, with 95 % intervals"


def _grid(table: Table) -> Grid:
    grid = Grid()
    grid.add_column("")
    grid.add_column("")
    grid.add_column("switches", justify="right")
    for name in table.columns:
        grid.add_column(Text(name), justify="right")
    several = len(table.columns) > 1
    if several:
        grid.add_column("average", justify="right")
    for row in table.rows:
        average = [Text(interval(row.average))] if several else []
        grid.add_row(Text(row.name), Text(row.what), _spread(row.switches), *map(_cell, row.cells), *average)
    return grid


def _cell(cell: Cell) -> Text:
    text = Text(interval(cell.rate))
    if cell.draws is not None:
        text.append(f"\nfrom {100 * cell.draws.least:.1f} to {100 * cell.draws.most:.1f}")
    return text.append(_NO_INPUTS) if cell.no_inputs else text


def _spread(spread: Spread) -> str:
    return f"{spread.least:g}" if spread.least == spread.most else f"{spread.least:g}-{spread.most:g}"


def _print_confusions(console: Console, study: Study) -> None:
    for table in study.tables:
        for row in table.rows if table.name == "compositions" else ():
            for name, cell in zip(table.columns, row.cells, strict=True):
                console.print()
                console.print(Text(f"{row.name} {row.what}, subject {name}, {table.protocol} protocol", "bold"))
                console.print(_matrix(study.grasps, cell))


def _matrix(grasps: tuple[str, ...], cell: Cell) -> Grid:
    grid = Grid()
    for heading in ("true \\ found", *grasps):
        grid.add_column(Text(heading), justify="right")
    for grasp, counts in zip(grasps, cell.confusion or (), strict=True):
        grid.add_row(Text(grasp), *(str(count) if count else "." for count in counts))
    return grid
