"""The catalogue run on all cores, and what came of it: a line a check, whatever else goes wrong."""

import traceback
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from functools import partial
from pathlib import Path

import msgspec

from thenar.compiler.workers import in_workers

from .catalogue import load
from .finding import Case, Finding
from .weka.beside import Beside, NotRun

Progress = Callable[[int, int], None]

_KILLED = "not finished: a worker process ended before its work was done, perhaps for want of memory"


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
        failure = _told(fault)
    return _reported(name, about, findings, failure)


def _reported(name: str, about: Case, findings: Sequence[Finding], failure: str | None) -> CaseReport:
    checks = tuple(Check(finding, finding.holds) for finding in findings)
    return CaseReport(name, about, checks, failure, failure is None and bool(checks) and all(c.holds for c in checks))


def _told(fault: Exception) -> str:
    """Return what was raised and where: "ZeroDivisionError in separable.py, line 40: division by zero"."""
    place = traceback.extract_tb(fault.__traceback__)[-1]
    return f"{type(fault).__name__} in {Path(place.filename).name}, line {place.lineno}: {fault}"
