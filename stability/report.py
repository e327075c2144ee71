"""Run the catalogue of hard cases on all cores, and format the results for the terminal."""

import math
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType

import msgspec

from thenar.compiler.workers import in_workers

from .finding import Case, Finding
from .weka import Differences, NotRun, WekaComparison

NAMES = (
    "elementary",
    "information",
    "targets",
    "stumpfits",
    "scoretables",
    "invariances",
    "separable",
    "logits",
    "degenerate",
    "columns",
    "codes",
    "contradictions",
    "weights",
    "quantisation",
    "missing",
    "contact",
    "statistics",
    "platform",
)


def load(name: str) -> ModuleType:
    """Return the module of case `name`, one of NAMES: its CASE, and its function findings(full)."""
    return import_module(f".cases.{name}", __package__)


Progress = Callable[[int, int], None]

_KILLED = "not finished: a worker process ended early, perhaps for lack of memory"


class Listed(msgspec.Struct, frozen=True):
    """A case of the catalogue."""

    name: str
    title: str
    danger: str


def listed(names: Sequence[str]) -> list[Listed]:
    """Return the titles and the dangers of the cases `names`."""
    return [Listed(name, *msgspec.structs.astuple(load(name).CASE)) for name in names]


class Check(msgspec.Struct, frozen=True):
    """A finding and its verdict."""

    finding: Finding
    holds: bool


class CaseReport(msgspec.Struct, frozen=True):
    """The findings of a case. `failure` describes an exception and its location; earlier findings are kept."""

    name: str
    about: Case
    checks: tuple[Check, ...]
    failure: str | None
    holds: bool


class Report(msgspec.Struct, frozen=True):
    """The results of the catalogue; `weka` is the comparison with Weka on a separable set, None if not requested."""

    full: bool
    cases: tuple[CaseReport, ...]
    weka: WekaComparison | NotRun | None
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
        found |= {name: _reported(name, Case(name, ""), [], _KILLED) for name in names if name not in found}
    return tuple(found[name] for name in names)


def run_case(name: str, *, full: bool) -> CaseReport:
    """Run one case with warnings as errors."""
    about, findings, failure = Case(name, ""), [], None
    try:
        module = load(name)
        about = module.CASE
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for finding in module.findings(full):
                findings.append(finding)  # noqa: PERF402  one by one, to keep those before a failure
    except Exception as fault:  # any exception fails this case only
        # "ZeroDivisionError in separable.py, line 40: division by zero"
        place = traceback.extract_tb(fault.__traceback__)[-1]
        failure = f"{type(fault).__name__} in {Path(place.filename).name}, line {place.lineno}: {fault}"
    return _reported(name, about, findings, failure)


def _reported(name: str, about: Case, findings: Sequence[Finding], failure: str | None) -> CaseReport:
    checks = tuple(Check(finding, finding.holds) for finding in findings)
    return CaseReport(name, about, checks, failure, failure is None and bool(checks) and all(c.holds for c in checks))


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


def bound_of(finding: Finding) -> str:
    """Return the bound with its unit."""
    return f"{figure(finding.bound)} {finding.unit}"


def verdict(check: Check) -> str:
    """Return the verdict in one or two words."""
    if check.holds:
        return "holds"
    return "FAILS" if check.finding.tried else "NOT TRIED"


def summary(report: Report) -> str:
    """Return a one-line summary."""
    checks = [check for case in report.cases for check in case.checks]
    tried = sum(check.finding.tried for check in checks)
    looked = f"{_count(len(report.cases), 'case')} {'in full' if report.full else 'quickly'}, "
    looked += f"{_count(len(checks), 'check')} on {_count(tried, 'input')}"
    if report.holds:
        return f"{looked}: all hold"
    bad = ", ".join(case.name for case in report.cases if not case.holds)
    return f"{looked}: NOT all hold, see {bad}"


def failures(report: Report) -> tuple[str, ...]:
    """Return a sentence per failure: the case, the check, the size of the error, and the worst input."""
    return tuple(f"{case.name}: {said}" for case in report.cases for said in _failures(case))


def _failures(case: CaseReport) -> Iterator[str]:
    for check in case.checks:
        if not check.holds:
            yield _fault(check.finding)
    if case.failure is not None:
        yield case.failure
    elif not case.checks:
        yield "it has no findings"


def _fault(finding: Finding) -> str:
    if not finding.tried:
        return f"{finding.check}: nothing was tried"
    often = f", beyond it {finding.beyond:,} times" if finding.beyond > 1 else ""
    where = f"; worst: {finding.worst}" if finding.worst else ""
    return (
        f"{finding.check}: {figure(finding.error)} {finding.unit} against a bound of {bound_of(finding)}{often}{where}"
    )


def legend(report: Report) -> tuple[tuple[str, str], ...]:
    """Return the units in use that need an explanation, each with its meaning."""
    units = {check.finding.unit for case in report.cases for check in case.checks}
    return tuple(
        (unit, meaning)
        for unit, meaning in _MEANINGS
        if any(each == unit or each.startswith(f"{unit} of ") for each in units)
    )


def weka_lines(weka: WekaComparison | NotRun) -> tuple[str, ...]:
    """Return the results of the comparison with Weka, one sentence per line."""
    if isinstance(weka, NotRun):
        return (f"not run: {weka.why}",)
    changed = f"after the last round {_count(weka.weka_changed, 'row')} of {weka.held_out} change class"
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


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"
