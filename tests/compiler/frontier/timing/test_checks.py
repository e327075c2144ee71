"""The model of classify times, held beside layouts that are compiled and simulated."""

from collections.abc import Callable
from statistics import fmean

import pytest

from thenar.compiler.firmware.simavr import missing
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.frontier.measure import steps_of, unmeasured
from thenar.compiler.frontier.timing.classify_times import ClassifyModel, fitting
from thenar.compiler.frontier.timing.python_times import PythonCost, random_tables

PYTHON = PythonCost(2.0, 0.03, 0.15, 0.03, 0.0002, 0.0009, 10.0)
TABLES = [random_tables(33, 16, 14), random_tables(20, 0, 14), random_tables(8, 0, 5)]


@pytest.fixture
def simavr(tool: Callable[[str], str]) -> None:
    for name in ("avr-gcc", "make"):
        tool(name)
    if missing() is not None:
        tool("libsimavr-dev")


@pytest.fixture
def qemu(tool: Callable[[str], str]) -> None:
    for name in ("arm-none-eabi-gcc", "qemu-system-arm"):
        tool(name)


@pytest.mark.usefixtures("simavr")
def test_cycles_of_an_avr_are_foretold_within_three_percent_and_never_too_few() -> None:
    part = TARGETS["avr328p"]
    for tables in TABLES[1:]:
        for layout, cost in fitting(tables, part)[:2]:
            counted = steps_of(layout, part)
            assert counted <= cost.cycles <= 1.03 * counted


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "tools", "mean", "worst"),
    [
        ("avr328p", "simavr", 0.01, 0.03),
        ("avr2560", "simavr", 0.01, 0.03),
        ("cortex-m0plus", "qemu", 0.25, 0.5),
        ("cortex-m4", "qemu", 0.25, 0.5),
    ],
)
def test_layouts_take_what_the_model_says(
    target: str, tools: str, mean: float, worst: float, request: pytest.FixtureRequest
) -> None:
    request.getfixturevalue(tools)
    part = TARGETS[target]
    several = [random_tables(switches, joints, 14) for switches in (5, 20, 33) for joints in (0, 4, 16)]
    options = [option for tables in several for option in fitting(tables, part)][::3]
    errors = [abs(cost.cycles / steps_of(layout, part) - 1) for layout, cost in options]
    assert fmean(errors) < mean
    assert max(errors) < worst


@pytest.mark.parametrize(("target", "gone"), [("avr328p", "avr-gcc"), ("cortex-m4", "arm-none-eabi-gcc")])
def test_without_its_tools_a_target_is_not_simulated_and_it_is_said_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, target: str, gone: str
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    reason = unmeasured(ClassifyModel(target))
    assert reason is not None
    assert gone in reason
    assert "apt-get install" in reason


def test_a_raspberry_pi_is_not_timed_elsewhere() -> None:
    assert "no Raspberry Pi" in str(unmeasured(ClassifyModel("pi", python=PYTHON, factor=4.0)))
    assert unmeasured(ClassifyModel("host", python=PYTHON)) is None
