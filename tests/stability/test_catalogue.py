"""Every case of the catalogue holds: quickly in `make test`, in full in `make test-slow`."""

import pkgutil

import msgspec
import pytest

from thenar.simulator.effects.contact_quasistatic import Quasistatic
from thenar.stability import cases
from thenar.stability.cases.contact import kept
from thenar.stability.inputs.hard_grasps import shipped
from thenar.stability.report import CASES, CaseReport, run_case


def test_every_case_in_the_folder_is_in_the_catalogue_once() -> None:
    assert sorted(CASES) == sorted(module.name for module in pkgutil.iter_modules(cases.__path__))


def test_every_case_has_a_title_and_a_danger_in_one_line() -> None:
    for about in CASES.values():
        assert about.title
        assert about.danger
        assert "\n" not in about.title + about.danger


def _holds(found: CaseReport) -> None:
    assert found.failure is None
    assert msgspec.json.decode(msgspec.json.encode(found), type=CaseReport) == found
    assert not [finding for finding in found.findings if not finding.holds]
    assert found.holds


@pytest.mark.parametrize("name", [name for name in CASES if name != "platform"])  # it starts programs: in full alone
def test_a_case_holds_quickly(name: str) -> None:
    _holds(run_case(name, full=False))


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_case_holds_in_full(name: str) -> None:
    _holds(run_case(name, full=True))


def test_most_shipped_grasps_settle_so_that_halved_steps_are_compared() -> None:
    loads = list(shipped(1))
    assert kept(loads, Quasistatic().solve(loads)).mean() > 0.9
