"""A run of the catalogue: one case's failure is its own, and nothing that fails can look as if it held."""

import math
import sys
import warnings
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from pathlib import Path

import pytest

from thenar.stability import cases, report
from thenar.stability.finding import Case, Finding, Worst
from thenar.stability.report import CaseReport, Check, Report, failures, figure, legend, run, run_case

SOUND = """
from thenar.stability.finding import Case, Finding
CASE = Case("a sound case", "nothing")
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
    (tmp_path / "finds_nothing.py").write_text(SOUND.replace("yield Finding", "if not CASE: yield Finding"))
    yield tmp_path
    for path in tmp_path.iterdir():
        sys.modules.pop(f"{cases.__name__}.{path.stem}", None)


def test_a_sound_case_holds_with_what_it_found(folder: Path) -> None:
    found = run_case("sound", full=True)
    assert found.holds
    assert (found.about.title, found.failure) == ("a sound case", None)
    assert [check.finding.error for check in found.checks] == [1.0]
    assert [check.finding.error for check in run_case("sound", full=False).checks] == [0.5]


@pytest.mark.parametrize("name", [*FAULTS, "finds_nothing"])
def test_a_case_in_which_anything_is_wrong_does_not_hold_and_keeps_its_name(folder: Path, name: str) -> None:
    found = run_case(name, full=False)
    assert not found.holds
    assert found.about.title == "a sound case"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("raises", "ZeroDivisionError in raises.py, line 6: division by zero"),
        ("warns", "RuntimeWarning in warns.py, line 7: divide by zero encountered"),
    ],
)
def test_a_case_that_raises_or_warns_says_what_and_where_and_keeps_what_it_had_found(
    folder: Path, name: str, said: str
) -> None:
    found = run_case(name, full=False)
    assert found.failure is not None
    assert found.failure.startswith(said)
    assert [check.holds for check in found.checks] == [True]


def test_the_others_are_run_all_the_same_and_stand_in_the_order_asked_for(folder: Path) -> None:
    seen: list[tuple[int, int]] = []
    found = run(["raises", "sound", "exceeds"], full=False, jobs=1, progress=lambda *at: seen.append(at))
    assert [(case.name, case.holds) for case in found] == [("raises", False), ("sound", True), ("exceeds", False)]
    assert seen == [(0, 3), (1, 3), (2, 3), (3, 3)]


def test_in_workers_a_case_that_is_not_there_has_failed_and_says_so() -> None:
    found = run(["nowhere", "nothing"], full=False, jobs=2)
    assert [case.failure is not None and "No module named" in case.failure for case in found] == [True, True]


def test_cases_that_a_killed_worker_left_unfinished_have_failed_and_the_finished_ones_stay(
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


def test_the_filter_of_warnings_is_put_back(folder: Path) -> None:
    before = list(warnings.filters)
    run_case("warns", full=False)
    assert list(warnings.filters) == before


@pytest.mark.parametrize(
    ("error", "tried", "holds"), [(1.0, 1, True), (1.5, 1, False), (math.inf, 1, False), (0, 0, False)]
)
def test_a_finding_holds_if_something_was_tried_and_the_error_is_a_number_within_the_bound(
    error: float, tried: int, holds: bool
) -> None:
    assert Finding("", "", error, 1.0, "ulp", tried).holds is holds


def test_the_worst_of_many_is_kept_with_where_it_was_and_nan_is_worse_than_all() -> None:
    worst = Worst("sums", "60 digits", 2.0, "ulp")
    for error, at in ((0.5, "a"), (1.5, "b"), (1.0, "c")):
        worst.see(error, at)
    assert worst.finding() == Finding("sums", "60 digits", 1.5, 2.0, "ulp", 3, "b")
    worst.see(2.5, "too much")
    worst.see(math.nan, "d", tried=4)
    worst.see(1.75, "e")
    assert (worst.finding().error, worst.finding().worst, worst.finding().tried) == (math.inf, "d", 9)
    assert worst.finding().beyond == 2


def reported(*findings: Finding, failure: str | None = None) -> Report:
    checks = tuple(Check(finding, finding.holds) for finding in findings)
    return Report(False, (CaseReport("case", Case("A case", ""), checks, failure, False),), None, False)


def test_all_that_fails_is_told_with_the_case_the_check_by_how_much_how_often_and_where() -> None:
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


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (0.0, "0"),
        (3.0, "3"),
        (12345.0, "12,345"),
        (1e9, "1e+09"),
        (0.51234, "0.512"),
        (2.2e-16, "2.2e-16"),
        (math.inf, "inf"),
    ],
)
def test_numbers_are_worded_for_people(number: float, words: str) -> None:
    assert figure(number) == words
