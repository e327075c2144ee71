from collections.abc import Callable
from dataclasses import asdict, replace

import pytest

from thenar.compiler.firmware.simavr import missing
from thenar.compiler.frontier.timing.checks import LEAST, check, unchecked
from thenar.compiler.frontier.timing.classify_times import ClassifyModel
from thenar.compiler.frontier.timing.python_times import PythonCost, random_tables
from thenar.compiler.frontier.timing.simulated import Outcome, scan_trials

PYTHON = PythonCost(2.0, 0.03, 0.15, 0.03, 0.0002, 0.0009, 10.0)
TABLES = [random_tables(33, 16, 14), random_tables(20, 0, 14), random_tables(8, 0, 5)]


@pytest.fixture
def simavr(tool: Callable[[str], str]) -> None:
    for name in ("avr-gcc", "make"):
        tool(name)
    if missing() is not None:
        tool("libsimavr-dev")


@pytest.mark.slow
@pytest.mark.usefixtures("simavr")
@pytest.mark.parametrize("target", ["avr328p", "avr2560"])
def test_at_least_thirty_classifiers_are_run_on_a_simulated_avr(target: str) -> None:
    found, scans = check(ClassifyModel(target), TABLES, jobs=1)
    assert (found.n, found.how) == (LEAST, "simulated")
    assert 0 < found.mean_error < found.worst_error < 0.1
    assert (scans.n, scans.how) == (len(scan_trials(target)), "simulated")
    assert "scan" in scans.what


def test_python_is_timed_on_thirty_tables_even_where_one_is_given() -> None:
    (found,) = check(ClassifyModel("host", python=PYTHON), TABLES[:1])
    assert (found.n, found.how) == (LEAST, "measured")
    assert found.worst_error >= found.mean_error > 0


def test_a_model_that_is_off_is_found_out() -> None:
    tenfold = replace(PYTHON, **{name: 10 * weight for name, weight in asdict(PYTHON).items() if name != "yardstick"})
    (found,) = check(ClassifyModel("host", python=tenfold), TABLES)
    assert found.mean_error > 1.0


def test_tables_too_small_for_thirty_points_give_as_many_as_there_are() -> None:
    (found,) = check(ClassifyModel("host", python=PYTHON), [random_tables(3, 0, 4)])
    assert found.n == 3


def test_without_tables_nothing_is_checked() -> None:
    assert check(ClassifyModel("avr328p"), []) == check(ClassifyModel("host", python=PYTHON), []) == ()


def test_without_its_tools_a_target_is_not_checked_and_it_is_said_what_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    model = ClassifyModel("avr328p")
    assert check(model, TABLES) == ()
    reason = unchecked(model)
    assert reason is not None
    assert "avr-gcc" in reason
    assert "apt-get install" in reason


def test_a_raspberry_pi_is_not_checked_elsewhere() -> None:
    model = ClassifyModel("pi", python=PYTHON, factor=4.0)
    assert check(model, TABLES) == ()
    assert "no Raspberry Pi" in str(unchecked(model))
    assert unchecked(ClassifyModel("host", python=PYTHON)) is None


def test_an_error_is_a_share_of_what_was_counted() -> None:
    assert Outcome(110.0, 100.0).error == pytest.approx(0.1)
    assert Outcome(90.0, 100.0).error == pytest.approx(0.1)
