"""`thenar stability`: run every hard numerical case, and compare it with the truth."""

from collections.abc import Iterable
from importlib.util import find_spec
from typing import TYPE_CHECKING

import click

from .consoles import Console, Text
from .parameters import OneOf, jobs_option
from .printing import json_flag, out, progress, show, table

if TYPE_CHECKING:
    from thenar.stability.report import CaseReport, Report

# Packages that a run imports at some point: better reported missing once at the start than in each case.
_NEEDED = ("mpmath", "joblib", "scipy", "sklearn")
_HEADS = ("check", "reference", "tried", "worst error", "bound", "verdict")
_NUMBERS = ("tried", "worst error")


def _names() -> Iterable[str]:
    from thenar.stability.report import CASES

    return CASES


@click.command("stability")
@click.argument("cases", nargs=-1, metavar="[CASE]...", type=OneOf("case", _names))
@click.option("--full", is_flag=True, help="Try more and harder inputs, such as 10,000 rounds of boosting: minutes.")
@jobs_option("Worker processes. The result does not depend on it.")
@json_flag
def command(cases: tuple[str, ...], full: bool, jobs: int) -> int:
    """Run the hard cases: what could go wrong numerically, the truth each is compared with, and the worst error.

    Without a CASE, run all of them. The truth is recomputed with 60 digits, independently of the product, or is a fact
    that must hold exactly. Exits with 1 if an error exceeds its bound. A run of all cases also shows Weka's results
    under two settings of its JVM, if java and Weka 3.6 are installed.

    \b
    Example:
        thenar stability
        thenar stability --full
        thenar stability separable weights
    """
    cases = tuple(name for name in _names() if not cases or name in cases)
    for name in _NEEDED:
        if find_spec(name) is None:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    from thenar.stability.report import CASES, Report, run
    from thenar.stability.weka import compare_with_weka

    with progress("hard cases") as report:
        found = run(cases, full=full, jobs=jobs, progress=report)
    with progress("comparing with Weka"):
        weka = compare_with_weka() if cases == tuple(CASES) else None
    result = Report(full, found, weka, all(case.holds for case in found))
    show(result, _print)
    return 0 if result.holds else 1


def _print(report: "Report") -> None:
    """Print a table for each case, headed by what could go wrong, then Weka's results and the failures, if any."""
    from thenar.stability.report import failures, legend, summary, weka_lines

    console = out()
    for case in report.cases:
        _print_case(console, case)
    if report.weka is not None:
        console.print(Text("compared with Weka", "bold"))
        for line in weka_lines(report.weka):
            console.print(line)
        console.print()
    for unit, meaning in legend(report):
        console.print(Text(f"{unit}: {meaning}", "dim"))
    console.print()
    for failure in failures(report):
        console.print(Text(failure, "red"))
    console.print(Text(summary(report), "bold green" if report.holds else "bold red"))


def _print_case(console: Console, case: "CaseReport") -> None:
    from thenar.stability.report import figure, verdict

    console.print(Text(f"{case.name}: {case.about.title}", "bold"))
    if case.about.danger:
        console.print(Text(f"What could go wrong: {case.about.danger}", "dim"))
    checks = table(_HEADS, _NUMBERS)
    for finding in case.findings:
        style = "green" if finding.holds else "bold red"
        error = (f"{finding.tried:,}", figure(finding.error), f"{figure(finding.bound)} {finding.unit}")
        checks.add_row(finding.check, finding.reference, *error, Text(verdict(finding), style))
    if case.findings:
        console.print(checks)
    if case.failure is not None:
        console.print(Text(f"FAILED: {case.failure}", "red"))
    console.print()
