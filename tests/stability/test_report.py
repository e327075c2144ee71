"""A run of the catalogue: one case's failure is its own, and nothing that fails can look as if it held."""

import math
import sys
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from pathlib import Path

import pytest

from thenar.stability import cases, report
from thenar.stability.finding import Case, Finding
from thenar.stability.report import CaseReport, Report, failures, legend, run, run_case

SOUND = """
from thenar.stability.finding import Finding
def findings(full):
    yield Finding("one", "the rule itself", 1.0 if full else 0.5, 1.0, "ulp", 3)
"""
FAULTS = {
    "raises": "    1 / 0\n",
    "warns": "    import numpy\n    numpy.float64(1) / numpy.float64(0)\n",
    "exceeds": "    yield Finding('two', 'the rule itself', 1.5, 1.0, 'ulp', 3, 'row 7')\n",
    "tries_nothing": "    yield Finding('two', 'the rule itself', 0.0, 1.0, 'ulp', 0)\n",
    "has_no_number": "    yield Finding('two', 'the rule itself', float('nan'), 1.0, 'ulp', 3)\n",
}


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """A folder of cases that stands beside the shipped ones."""
    monkeypatch.setattr(cases, "__path__", [*cases.__path__, str(tmp_path)])
    (tmp_path / "sound.py").write_text(SOUND)
    for name, fault in FAULTS.items():
        (tmp_path / f"{name}.py").write_text(SOUND + fault)
    (tmp_path / "finds_nothing.py").write_text(SOUND.replace("yield Finding", "if full is None: yield Finding"))
    names = ("sound", "finds_nothing", *FAULTS)
    monkeypatch.setattr(report, "CASES", dict.fromkeys(names, Case("a sound case", "nothing")))
    yield tmp_path
    for path in tmp_path.iterdir():
        sys.modules.pop(f"{cases.__name__}.{path.stem}", None)


@pytest.mark.parametrize("name", [*FAULTS, "finds_nothing"])
def test_a_failing_case_keeps_its_name(folder: Path, name: str) -> None:
    found = run_case(name, full=False)
    assert not found.holds
    assert found.about.title == "a sound case"


def test_a_killed_workers_unfinished_cases_fail_finished_ones_stay(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed_after_one(work: object, names: list[str], jobs: int) -> Iterator[object]:
        assert callable(work)
        yield work(names[0])
        raise BrokenExecutor

    monkeypatch.setattr(report, "in_workers", killed_after_one)
    found = run(["sound", "exceeds"], full=False)
    assert [case.holds for case in found] == [True, False]
    assert found[1].failure is not None
    assert "a worker process ended early" in found[1].failure


def test_the_worst_is_kept_with_its_place_nan_worst() -> None:
    worst = Finding.of("sums", "60 digits", 2.0, "ulp")
    for error, at in ((0.5, "a"), (1.5, "b"), (1.0, "c")):
        worst.see(error, at)
    assert worst == Finding("sums", "60 digits", 1.5, 2.0, "ulp", 3, "b")
    worst.see(2.5, "too much")
    worst.see(math.nan, "d", tried=4)
    worst.see(1.75, "e")
    assert (worst.error, worst.worst, worst.tried) == (math.inf, "d", 9)
    assert worst.beyond == 2


def reported(*findings: Finding, failure: str | None = None) -> Report:
    return Report(False, (CaseReport("case", Case("A case", ""), findings, failure, False),), None, False)


def test_failures_name_case_check_size_count_and_place() -> None:
    report = reported(
        Finding("sums", "60 digits", 0.5, 1.0, "ulp", 3, "row 1"),
        Finding("shares", "60 digits", 1.5, 1.0, "x rounding", 3000, "row 2", 1234),
        Finding("trees", "the rule itself", 1, 0, "trees", 3, beyond=1),
        Finding("steps", "the rule itself", 0, 0, "steps", 0),
        failure="ValueError in case.py, line 3: no",
    )
    assert failures(report) == (
        "case: shares: 1.5 x rounding against a bound of 1 x rounding, beyond it 1,234 times; worst: row 2",
        "case: trees: 1 trees against a bound of 0 trees",
        "case: steps: nothing was tried",
        "case: ValueError in case.py, line 3: no",
    )
    assert failures(reported()) == ("case: it has no findings",)


def test_the_legend_explains_each_unit_that_occurs_and_no_other() -> None:
    units = ("x 2^-53 of the force", "rows", "ulp", "x 2^-53")
    found = legend(reported(*(Finding("sums", "60 digits", 0, 1, unit, 1) for unit in units)))
    assert [unit for unit, _ in found] == ["ulp", "x 2^-53"]
