from typing import Any

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.policy import Policy


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"lead": -0.1}, "a lead of -0.1"),
        ({"lead": float("nan")}, "a lead of nan"),
        ({"lead": float("inf")}, "a lead of inf"),
        ({"dwell_us": -1}, "a dwell of -1 us"),
        ({"dwell_us": 11, "hold_us": 10}, "0 <= dwell <= hold is needed"),
        ({"max_lost": -0.1}, "0 to 1"),
        ({"max_lost": 1.1}, "0 to 1"),
        ({"lead": 1e308}, "in score units"),
        ({"lag_us": -1}, "a lag of -1 us is out of range: use 0 to 10000000"),
        ({"lag_us": 10_000_001}, "use 0 to 10000000"),
    ],
)
def test_what_makes_no_sense_is_refused(values: dict[str, Any], reason: str) -> None:
    with pytest.raises(SettingError, match=reason):
        Policy(**values)


def test_the_ends_of_the_ranges_are_allowed() -> None:
    Policy(lead=0, dwell_us=0, hold_us=0, max_lost=0.0)
    Policy(dwell_us=7, hold_us=7, max_lost=1.0, lag_us=0)
    Policy(lag_us=10_000_000)
    Policy(lag_us=None)


@pytest.mark.parametrize(("lead", "scale", "steps"), [(0.0, 300.0, 0), (0.5, 300.0, 150), (0.5, 301.0, 151)])
def test_a_lead_in_steps_is_rounded_up(lead: float, scale: float, steps: int) -> None:
    assert Policy(lead=lead).lead_steps(scale) == steps
