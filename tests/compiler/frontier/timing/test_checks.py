"""The model of classify times, held beside layouts that are compiled and simulated."""

import pytest

from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.frontier.price import ClassifyModel, count_steps, fitting, random_tables
from thenar.runtime.model.integers import tables_to_bytes

from ....conftest import tool

PYTHON = (2.0, 0.03, 0.15, 0.03, 0.0002, 0.0009, 10.0)
TABLES = [random_tables(33, 16, 14), random_tables(20, 0, 14), random_tables(8, 0, 5)]


@pytest.fixture
def simavr() -> None:
    for name in ("avr-gcc", "make"):
        tool(name)
    if TARGETS["avr328p"].missing() is not None:
        tool("libsimavr-dev")


@pytest.mark.usefixtures("simavr")
def test_cycles_of_an_avr_are_foretold_within_ten_percent() -> None:
    part = TARGETS["avr328p"]
    for tables in TABLES[1:]:
        fit = fitting(tables, part)
        assert fit is not None
        assert fit.cost is not None
        assert fit.cost.cycles == pytest.approx(count_steps(tables_to_bytes(tables), ClassifyModel("avr328p")), rel=0.1)


def test_a_target_without_tools_names_what_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    reason = ClassifyModel("avr328p").unmeasured
    assert "avr-gcc" in reason
    assert "apt-get install" in reason


def test_a_raspberry_pi_is_not_timed_elsewhere() -> None:
    assert "no Raspberry Pi" in ClassifyModel("pi", python=PYTHON).unmeasured
    assert not ClassifyModel("host", python=PYTHON).unmeasured
