"""What `thenar frontier` prints: points as a table, how far its models can be trusted, and how to read the picture."""

from typing import TYPE_CHECKING

from .common import out

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from thenar.compiler.frontier.points import Check, Frontier, Point

_WORDS = ("inputs", "placement", "rounds, bits", "wiring", "scan", "decision")
_NUMBERS = ("rate %", "left out %", "frame", "latency, 99 %", "flash", "RAM")


def print_frontier(frontier: "Frontier") -> None:
    """Print the points, the picked one bold; then checks, what was left out, and what the picture says."""
    from rich.text import Text

    from thenar.compiler.frontier.drawing.sentence import sentence

    console = out()
    console.print(_grid(frontier))
    console.print(
        Text("rates with 95 % intervals; left out: each subject from the others; flash and RAM in bytes", "dim")
    )
    for check in frontier.checks:
        console.print(Text(_check(check)))
    for missing in frontier.skipped:
        console.print(Text(missing, "yellow"))
    console.print()
    console.print(Text(sentence(frontier), "bold"))


def _grid(frontier: "Frontier") -> "Table":
    from rich.table import Table
    from rich.text import Text

    grid = Table(title=Text(_title(frontier)))
    for head in ("point", "switches"):
        grid.add_column(head, justify="right")
    for head in _WORDS:
        grid.add_column(head)
    for head in _NUMBERS:
        grid.add_column(head, justify="right")
    for point in frontier.points:
        grid.add_row(*_cells(point), style="bold" if point.number == frontier.picked else None)
    return grid


def _title(frontier: "Frontier") -> str:
    wanted = f"; {frontier.wanted}: point {frontier.picked}" if frontier.picked is not None else ""
    return f"The best of {frontier.combinations:,} combinations, {frontier.source} on {frontier.target}{wanted}"


def _cells(point: "Point") -> "tuple[Text, ...]":
    from rich.text import Text

    from thenar.compiler.frontier.drawing.words import way_of, wiring_of
    from thenar.compiler.text import duration, interval

    setting = point.setting
    texts = (
        str(point.number),
        str(len(point.switches)),
        setting.inputs,
        way_of(setting),
        f"{setting.rounds}, {setting.width}",
        wiring_of(setting),
        setting.scan if setting.clock_hz else "",
        setting.decision,
        interval(point.rate),
        interval(point.left_out) if point.left_out is not None else "",
        f"{duration(point.frame.us)} {point.frame.how}",
        f"{duration(point.latency.mean_us)}, {duration(point.latency.p99_us)}",
        f"{point.flash:,}",
        f"{point.ram:,}",
    )
    return tuple(map(Text, texts))


def _check(check: "Check") -> str:
    return (
        f"{check.what}, {check.how}: {check.n} times held against its model, "
        f"off by {check.mean_error:.1%} in the mean, {check.worst_error:.1%} at worst"
    )
