from collections.abc import Callable

import pytest

from thenar.compiler.firmware.simavr import missing
from thenar.compiler.frontier.timing.simulated import ScanTrial, run_scan, scan_trials


@pytest.fixture(autouse=True)
def simavr(tool: Callable[[str], str]) -> None:
    for name in ("avr-gcc", "make"):
        tool(name)
    if missing() is not None:
        tool("libsimavr-dev")


def test_a_scan_by_the_firmware_of_a_simulated_board_takes_what_is_predicted() -> None:
    outcome = run_scan(ScanTrial("avr328p", "mcp23017", 33, 400_000))
    assert outcome.error < 0.05
    # More than the wire alone, by far: three chips at 400 kHz.
    assert outcome.counted > 2 * 341.4


@pytest.mark.slow
@pytest.mark.parametrize("platform", ["avr328p", "avr2560"])
def test_scans_of_all_sizes_take_what_is_predicted(platform: str) -> None:
    trials = scan_trials(platform)
    errors = {trial: run_scan(trial).error for trial in trials}
    print(errors)
    assert {trial.clock_hz for trial in trials} == {100_000, 400_000}
    assert max(errors.values()) < 0.08
    assert sum(errors.values()) / len(errors) < 0.03
