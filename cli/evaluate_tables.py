"""The tables of `thenar evaluate` on the terminal, laid out as in the paper."""

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from thenar.compiler.evaluation.populations import PROTOCOLS
from thenar.compiler.evaluation.study import Cell, RateTable, Study
from thenar.compiler.text import interval

from .common import out


def print_study(study: Study, *, confusion: bool) -> None:
    """Print all tables, and the confusion matrices if asked for."""
    console = out()
    for protocol in PROTOCOLS:
        if protocol.name in study.options.protocols:
            console.print(f"Protocol {protocol.name}: {protocol.meaning}")
    for table in study.tables:
        console.print()
        console.print(Text(table.title, "bold"))
        console.print(_grid(table))
        if table.note:
            console.print(table.note)
    console.print()
    for missing in study.left_out:
        console.print(f"no table of {missing.name}: {missing.reason}")
    console.print(str(study))
    if confusion:
        _print_confusions(console, study)


def _grid(table: RateTable) -> Grid:
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
        rates = [Text(str(cell)) for cell in row.cells]
        grid.add_row(Text(row.name), Text(row.what), str(row.switches), *rates, *average)
    return grid


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
