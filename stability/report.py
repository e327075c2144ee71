"""Run the catalogue of hard cases on all cores, and format the results for the terminal."""

import math
import traceback
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType

import msgspec

from thenar.compiler.text import counted
from thenar.compiler.workers import in_workers

from .finding import Case, Finding
from .weka import Differences, WekaComparison

Progress = Callable[[int, int], None]

_KILLED = "not finished: a worker process ended early, perhaps for lack of memory"

CASES = {
    "elementary": Case(
        "Elementary functions",
        "an exp or log off by a few ulps, or a share outside 0..1, affects every later probability",
    ),
    "information": Case(
        "Information gain",
        "a gain made by rounding decides which switch is kept; a gain of one count in 10^9 is taken for zero",
    ),
    "targets": Case(
        "Weights and working responses",
        "1/P for P = 0, weights that underflow or turn negative, responses beyond their clamp",
    ),
    "stumpfits": Case(
        "Stump fits",
        "a branch's output is the residue of rounding its weight, and rounding breaks ties between columns",
    ),
    "scoretables": Case(
        "Score tables", "scores drift over thousands of rounds, tables differ from the stumps they are made of"
    ),
    "invariances": Case(
        "Scale-free facts",
        "the order of rows, columns or classes, copies, units or names of codes change the trained model",
    ),
    "separable": Case(
        "Separable classes",
        "P goes to 0 and 1, 1/P to infinity, weights to 0; training goes on forever, and tables overflow",
    ),
    "logits": Case(
        "Additive logit",
        "scores grow without bound, a step overshoots, or rounding ends the search before the minimum is reached",
    ),
    "degenerate": Case(
        "Degenerate sets", "an almost empty set ends in a warning, a traceback, or a silently wrong result"
    ),
    "columns": Case(
        "Uninformative and duplicate columns",
        "rounding decides between equal columns, or a tree without a gain stops silently",
    ),
    "codes": Case(
        "Codes and degrees at their ends",
        "a threshold falls on the wrong side of a code, or a value gets a code that is not the nearest",
    ),
    "contradictions": Case(
        "Contradictions",
        "frames that belong to several classes make boosting oscillate; one row among 10^6 is rounded away",
    ),
    "weights": Case("Weights", "weights underflow, or one holds everything, and outputs are rounding residue"),
    "quantisation": Case("Integers of 4 to 16 bits", "rounding changes a score or a decision more than guaranteed"),
    "missing": Case(
        "Missing ports and silent joints",
        "with fitted rows for missing inputs a sum overflows, or the loss is not reported",
    ),
    "contact": Case(
        "Contact in the simulator",
        "no weight, no contact or all contact at one point: NaN forces, or an unsettled grasp reported as settled",
    ),
    "statistics": Case(
        "Rates at their ends", "an interval leaves 0 to 1, has no width, or is too narrow for trials that are alike"
    ),
    "platform": Case(
        "The platform", "the same recordings give another build with other threads, processor instructions or Python"
    ),
}


def load(name: str) -> ModuleType:
    """Return the module of case `name`: its function findings(full)."""
    return import_module(f".cases.{name}", __package__)


class CaseReport(msgspec.Struct, frozen=True):
    """The findings of a case. `failure` describes an exception and its location; earlier findings are kept."""

    name: str
    about: Case
    findings: tuple[Finding, ...]
    failure: str | None
    holds: bool


class Report(msgspec.Struct, frozen=True):
    """The results of the catalogue; `weka` is the comparison with Weka on a separable set, or the reason why
    there is none; None if not requested.
    """

    full: bool
    cases: tuple[CaseReport, ...]
    weka: WekaComparison | str | None
    holds: bool


def run(
    names: Sequence[str], *, full: bool, jobs: int = -1, progress: Progress | None = None
) -> tuple[CaseReport, ...]:
    """Run the cases `names`, each in a worker process (`jobs` as for in_workers), and return them in that order.

    A case that raises or warns has failed, as has each case that was unfinished when a worker was killed.
    """
    progress = progress or (lambda done, total: None)
    found: dict[str, CaseReport] = {}
    progress(0, len(names))
    try:
        for report in in_workers(partial(run_case, full=full), names, jobs):
            found[report.name] = report
            progress(len(found), len(names))
    except BrokenExecutor:
        found |= {name: _reported(name, [], _KILLED) for name in names if name not in found}
    return tuple(found[name] for name in names)


def run_case(name: str, *, full: bool) -> CaseReport:
    """Run one case with warnings as errors."""
    findings: list[Finding] = []
    failure = None
    try:
        case = load(name)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for finding in case.findings(full):
                findings.append(finding)  # noqa: PERF402  one by one, to keep those before a failure
    except Exception as fault:  # any exception fails this case only
        # "ZeroDivisionError in separable.py, line 40: division by zero"
        place = traceback.extract_tb(fault.__traceback__)[-1]
        failure = f"{type(fault).__name__} in {Path(place.filename).name}, line {place.lineno}: {fault}"
    return _reported(name, findings, failure)


def _reported(name: str, findings: Sequence[Finding], failure: str | None) -> CaseReport:
    holds = failure is None and bool(findings) and all(finding.holds for finding in findings)
    return CaseReport(name, CASES[name], tuple(findings), failure, holds)


# The meanings of units, in the order of the legend. Other units count violations, or are self-explanatory.
_MEANINGS = (
    ("ulp", "the distance from the true number to the next double"),
    ("x 2^-53", "times 2^-53 of the number, or of the named quantity: the largest error of one rounding"),
    ("x rounding", "times the largest possible effect of rounding on this number, summed for each input"),
    ("of the bound", "as a share of a bound that is computed for each input"),
    ("steps", "integers: entries of the integer tables, or a joint's codes"),
)


def figure(number: float) -> str:
    """Format a number: integers below a million exactly, others to three digits."""
    whole = math.isfinite(number) and number == round(number) and abs(number) < 1e6
    return f"{round(number):,}" if whole else f"{number:.3g}"


def verdict(finding: Finding) -> str:
    """Return the verdict in one or two words."""
    if finding.holds:
        return "holds"
    return "FAILS" if finding.tried else "NOT TRIED"


def summary(report: Report) -> str:
    """Return a one-line summary."""
    findings = [finding for case in report.cases for finding in case.findings]
    tried = sum(finding.tried for finding in findings)
    looked = f"{counted(len(report.cases), 'case')} {'in full' if report.full else 'quickly'}, "
    looked += f"{counted(len(findings), 'check')} on {counted(tried, 'input')}"
    if report.holds:
        return f"{looked}: all hold"
    bad = ", ".join(case.name for case in report.cases if not case.holds)
    return f"{looked}: NOT all hold, see {bad}"


def failures(report: Report) -> tuple[str, ...]:
    """Return a sentence per failure: the case, the check, the size of the error, and the worst input."""
    found = []
    for case in report.cases:
        faults = [_fault(finding) for finding in case.findings if not finding.holds]
        if case.failure is not None or not case.findings:
            faults.append(case.failure or "it has no findings")
        found += [f"{case.name}: {fault}" for fault in faults]
    return tuple(found)


def _fault(finding: Finding) -> str:
    if not finding.tried:
        return f"{finding.check}: nothing was tried"
    often = f", beyond it {finding.beyond:,} times" if finding.beyond > 1 else ""
    where = f"; worst: {finding.worst}" if finding.worst else ""
    error, bound = (f"{figure(number)} {finding.unit}" for number in (finding.error, finding.bound))
    return f"{finding.check}: {error} against a bound of {bound}{often}{where}"


def legend(report: Report) -> tuple[tuple[str, str], ...]:
    """Return the units in use that need an explanation, each with its meaning."""
    units = {finding.unit for case in report.cases for finding in case.findings}
    return tuple(
        (unit, meaning)
        for unit, meaning in _MEANINGS
        if any(each == unit or each.startswith(f"{unit} of ") for each in units)
    )


def weka_lines(weka: WekaComparison | str) -> tuple[str, ...]:
    """Return the results of the comparison with Weka, one sentence per line."""
    if isinstance(weka, str):
        return (f"not run: {weka}",)
    changed = f"after the last round {counted(weka.weka_changed, 'row')} of {weka.held_out} change class"
    return (
        f"Weka {weka.weka} and thenar, {weka.rounds} rounds on {weka.rows} rows of {weka.classes} classes that "
        f"stumps overfit; largest differences between their probabilities for {weka.held_out} other rows:",
        f"{_apart(weka.weka_itself, 'Weka with the two exp() settings of the JVM')}; {changed}",
        _apart(weka.ours_processor, "thenar and Weka with the processor's exp(), the default"),
        _apart(weka.ours_java, "thenar and Weka with Java's portable exp()"),
    )


def _apart(differences: Differences, who: str) -> str:
    parts = differences.parts
    if parts is None:
        return f"{who}: at most {figure(max(differences.largest, default=0.0))}, in all rounds"
    most = figure(max(differences.largest[: parts - 1], default=0.0))
    return f"{who}: at most {most} until they diverge in round {parts}, then up to {figure(max(differences.largest))}"
