"""The catalogue of hard cases run on all cores, what came of it, and how terminal and page word it."""

import math
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

import msgspec

from thenar.compiler.workers import in_workers

from .finding import Case, Finding
from .weka import Beside, Differences, NotRun

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


class CaseModule(Protocol):
    """A module of `cases`."""

    CASE: Case

    @staticmethod
    def findings(full: bool) -> Iterator[Finding]:
        """Run the case, quickly or in full, and yield what it finds, in an order that does not vary."""


def load(name: str) -> CaseModule:
    """Return the module of case `name`, one of NAMES."""
    return cast("CaseModule", import_module(f".cases.{name}", __package__))


Progress = Callable[[int, int], None]

_KILLED = "not finished: a worker process ended before its work was done, perhaps for want of memory"


class Listed(msgspec.Struct, frozen=True):
    """A case of the catalogue."""

    name: str
    title: str
    danger: str


def listed(names: Sequence[str]) -> list[Listed]:
    """Return what the cases `names` are, and what could go wrong in each."""
    return [Listed(name, *msgspec.structs.astuple(load(name).CASE)) for name in names]


class Check(msgspec.Struct, frozen=True):
    """A finding and the verdict on it."""

    finding: Finding
    holds: bool


class CaseReport(msgspec.Struct, frozen=True):
    """What a case found. `failure` says what it raised, and where; what it had found until then is there too."""

    name: str
    about: Case
    checks: tuple[Check, ...]
    failure: str | None
    holds: bool


class Report(msgspec.Struct, frozen=True):
    """What the catalogue found; `beside` is what Weka said on a separable set, None where nobody asked for it."""

    full: bool
    cases: tuple[CaseReport, ...]
    beside: Beside | NotRun | None
    holds: bool


def run(
    names: Sequence[str], *, full: bool, jobs: int = -1, progress: Progress | None = None
) -> tuple[CaseReport, ...]:
    """Run the cases `names`, each in a worker process (`jobs` as for in_workers), and return them in that order.

    A case that raises, or warns, has failed and says so; so has each that was not finished when a worker was killed.
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
    """Run one case, its warnings turned into errors."""
    about, findings, failure = Case(name, ""), [], None
    try:
        module = load(name)
        about = module.CASE
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for finding in module.findings(full):
                findings.append(finding)  # noqa: PERF402  one by one: those before a failure stay
    except Exception as fault:  # whatever it is, it is this case's failure, and no other's
        # "ZeroDivisionError in separable.py, line 40: division by zero"
        place = traceback.extract_tb(fault.__traceback__)[-1]
        failure = f"{type(fault).__name__} in {Path(place.filename).name}, line {place.lineno}: {fault}"
    return _reported(name, about, findings, failure)


def _reported(name: str, about: Case, findings: Sequence[Finding], failure: str | None) -> CaseReport:
    checks = tuple(Check(finding, finding.holds) for finding in findings)
    return CaseReport(name, about, checks, failure, failure is None and bool(checks) and all(c.holds for c in checks))


# What units mean, in the order of the legend. All others count what is wrong, or speak for themselves.
_MEANINGS = (
    ("ulp", "the distance from the true number to the next double"),
    ("x 2^-53", "times 2^-53 of the number, or of what is named: by so much one rounding can be off"),
    ("x rounding", "times the most that rounding can do to that very number, added up for each input"),
    ("x growth", "the same, with what later rounds make of the roundings of earlier ones"),
    ("of the bound", "as a share of a bound that is worked out for each input"),
    ("steps", "whole numbers: those of the integer tables, or a joint's codes"),
)


def figure(number: float) -> str:
    """Return a number for people: whole ones below a million whole, others to three digits."""
    whole = math.isfinite(number) and number == round(number) and abs(number) < 1e6
    return f"{round(number):,}" if whole else f"{number:.3g}"


def error_of(finding: Finding) -> str:
    """Return the worst error with its unit."""
    return f"{figure(finding.error)} {finding.unit}"


def bound_of(finding: Finding) -> str:
    """Return the most that the error may be."""
    return f"{figure(finding.bound)} {finding.unit}"


def verdict(check: Check) -> str:
    """Return the verdict as a word or two."""
    if check.holds:
        return "holds"
    return "FAILS" if check.finding.tried else "NOT TRIED"


def summary(report: Report) -> str:
    """Return the sum of it all in a line."""
    checks = [check for case in report.cases for check in case.checks]
    tried = sum(check.finding.tried for check in checks)
    looked = f"{_count(len(report.cases), 'case')} {'in full' if report.full else 'quickly'}, "
    looked += f"{_count(len(checks), 'check')} on {_count(tried, 'input')}"
    if report.holds:
        return f"{looked}: all hold"
    bad = ", ".join(case.name for case in report.cases if not case.holds)
    return f"{looked}: NOT all hold, see {bad}"


def failures(report: Report) -> tuple[str, ...]:
    """Return a sentence for all that fails: the case, what was looked at, by how much it fails, and where worst."""
    return tuple(f"{case.name}: {said}" for case in report.cases for said in _failures(case))


def _failures(case: CaseReport) -> Iterator[str]:
    for check in case.checks:
        if not check.holds:
            yield _fault(check.finding)
    if case.failure is not None:
        yield case.failure
    elif not case.checks:
        yield "it finds nothing"


def _fault(finding: Finding) -> str:
    if not finding.tried:
        return f"{finding.check}: nothing was tried"
    often = f", beyond it {finding.beyond:,} times" if finding.beyond > 1 else ""
    where = f"; worst: {finding.worst}" if finding.worst else ""
    return f"{finding.check}: {error_of(finding)} against a bound of {bound_of(finding)}{often}{where}"


def legend(report: Report) -> tuple[tuple[str, str], ...]:
    """Return the units that occur and do not speak for themselves, each with what it means."""
    units = {check.finding.unit for case in report.cases for check in case.checks}
    occurring = (
        (unit, meaning)
        for unit, meaning in _MEANINGS
        if any(each == unit or each.startswith(f"{unit} of ") for each in units)
    )
    return tuple(occurring)


def besides(beside: Beside | NotRun) -> tuple[str, ...]:
    """Return what came of running Weka beside thenar, a sentence a line."""
    if isinstance(beside, NotRun):
        return (f"not run: {beside.why}",)
    changed = f"in the end {_count(beside.weka_changed, 'row')} of {beside.held_out} change class"
    return (
        f"Weka {beside.weka} and thenar, {beside.rounds} rounds on {beside.rows} rows of {beside.classes} classes that "
        f"stumps learn by heart; how far apart the probabilities are that they give to {beside.held_out} other rows:",
        f"{_apart(beside.weka_itself, 'Weka and itself, under the two exp() settings of the JVM')}; {changed}",
        _apart(beside.ours_processor, "thenar and Weka under the exp() of the processor, the default"),
        _apart(beside.ours_java, "thenar and Weka under the exp() written in Java"),
        f"thenar and itself, trained on the rows in {beside.shuffles} other orders: "
        + (f"at most {figure(beside.our_shuffled)}" if beside.our_shuffled else "the same bits"),
    )


def _apart(differences: Differences, who: str) -> str:
    parts = differences.parts
    if parts is None:
        return f"{who}: at most {figure(max(differences.largest, default=0.0))}, in all rounds"
    most = figure(max(differences.largest[: parts - 1], default=0.0))
    return f"{who}: at most {most} until they part in round {parts}, then by up to {figure(max(differences.largest))}"


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"
