"""What `thenar stability` prints on the terminal."""

from collections.abc import Sequence

from rich.console import Console, JustifyMethod
from rich.table import Table
from rich.text import Text

from thenar.stability.report import (
    CaseReport,
    Check,
    Listed,
    Report,
    besides,
    bound_of,
    failures,
    figure,
    legend,
    summary,
    verdict,
)
from thenar.stability.weka import Beside, NotRun

from .common import out

_HEADS = ("check", "held against", "tried", "worst error", "bound", "verdict")
_NUMBERS = ("tried", "worst error")
_CHECK, _REFERENCE = 0, 1  # the columns of words, which take what the others leave
_NARROWEST = 8
_GAP = 2


def print_list(cases: Sequence[Listed]) -> None:
    """Print the cases and what could go wrong in each."""
    table = Table("case", "what it is", "what could go wrong", show_lines=True)
    for case in cases:
        table.add_row(Text(case.name), Text(case.title), Text(case.danger))
    out().print(table)


def print_report(report: Report) -> None:
    """Print a table of each case under what could go wrong in it, what Weka said, and the sum: what fails, if any."""
    console = out()
    widths = _widths(report, console.width)
    for case in report.cases:
        _print_case(console, case, widths)
    if report.beside is not None:
        _print_beside(console, report.beside)
    for unit, meaning in legend(report):
        console.print(Text.assemble((unit, "bold"), f": {meaning}"), style="dim")
    console.print()
    for failure in failures(report):
        console.print(Text(failure, "red"))
    console.print(Text(summary(report), "bold green" if report.holds else "bold red"))


def _print_case(console: Console, case: CaseReport, widths: tuple[int, ...]) -> None:
    console.print(Text.assemble((case.name, "bold"), f": {case.about.title}"))
    if case.about.danger:
        console.print(Text(f"What could go wrong: {case.about.danger}", "dim"))
    table = Table(box=None, padding=(0, _GAP, 0, 0), pad_edge=False)
    for head, width in zip(_HEADS, widths, strict=True):
        justify: JustifyMethod = "right" if head in _NUMBERS else "left"
        table.add_column(head, width=width, justify=justify, header_style="dim", overflow="fold")
    for check in case.checks:
        table.add_row(*_cells(check))
    if case.checks:
        console.print(table)
    if case.failure is not None:
        console.print(Text(f"FAILED: {case.failure}", "red"))
    console.print()


def _cells(check: Check) -> tuple[Text, ...]:
    finding = check.finding
    texts = (finding.check, finding.reference, f"{finding.tried:,}", figure(finding.error), bound_of(finding))
    return (*map(Text, texts), Text(verdict(check), "green" if check.holds else "bold red"))


def _widths(report: Report, room: int) -> tuple[int, ...]:
    """Return the widths of the columns, the same for all cases: words wrap where they must, and nothing is cut."""
    columns = list(
        zip(_HEADS, *(map(str, _cells(check)) for case in report.cases for check in case.checks), strict=True)
    )
    whole = [max(map(len, column)) for column in columns]
    words = [max(len(word) for cell in column for word in cell.split()) for column in columns]
    widths = [min(_NARROWEST, words[_CHECK]), min(_NARROWEST, words[_REFERENCE]), *words[2:]]
    others = range(_REFERENCE + 1, len(_HEADS))
    left = room - _GAP * (len(_HEADS) - 1) - sum(widths)
    # First no word is broken, then no number; what is left goes to the words, three parts of five to the check.
    aims = [(_CHECK, words[_CHECK]), (_REFERENCE, words[_REFERENCE]), *((column, whole[column]) for column in others)]
    spare = max(0, left - sum(max(0, aim - widths[column]) for column, aim in aims))
    aims += [(_CHECK, words[_CHECK] + 3 * spare // 5), (_REFERENCE, whole[_REFERENCE]), (_CHECK, whole[_CHECK])]
    for column, aim in aims:
        more = max(0, min(aim, whole[column]) - widths[column])
        widths[column] += min(more, max(0, left))
        left -= more
    return tuple(widths)


def _print_beside(console: Console, beside: Beside | NotRun) -> None:
    console.print(Text("beside Weka", "bold"))
    for line in besides(beside):
        console.print(line)
    console.print()
