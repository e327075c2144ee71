from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.cyberglove_protocol import digitising_us, period_words, sending_us, shortest_us, told_us
from thenar.drivers.errors import SettingError


@pytest.mark.parametrize(
    ("rate_hz", "words"),
    [
        (1, (57600, 2)),
        (2, (57600, 1)),
        (10, (11520, 1)),
        (30, (3840, 1)),
        (45, (2560, 1)),
        (60, (1920, 1)),
        (75, (1536, 1)),
        (100, (1152, 1)),
        (None, (0, 0)),
    ],
)
def test_the_usual_rates_are_told_as_two_public_drivers_tell_them(
    rate_hz: float | None, words: tuple[int, int]
) -> None:
    assert period_words(rate_hz) == words


@given(st.floats(0.001, 115_200.0))
def test_the_told_period_is_the_nearest_but_for_the_rounding_of_two_words(rate_hz: float) -> None:
    words = period_words(rate_hz)
    assert all(0 < word <= 0xFFFF for word in words)
    # Half a tick in the product of the words, and half a tick in each of its factors' multiples.
    assert abs(told_us(words) * 0.1152 - 115_200 / rate_hz) <= 0.5 + words[1] / 2


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, nan, inf, 1e-9])
def test_no_glove_can_be_told_an_impossible_rate(rate_hz: float) -> None:
    with pytest.raises(SettingError, match="records a second"):
        period_words(rate_hz)


@pytest.mark.parametrize(
    ("sensors", "baud", "filtered", "rate_hz"),
    [
        (18, 115_200, False, 160),
        (18, 115_200, True, 118),
        (22, 115_200, False, 132),
        (22, 115_200, True, 97),
    ],
)
def test_the_highest_rates_are_those_that_the_vendors_formula_gives(
    sensors: int, baud: int, filtered: bool, rate_hz: int
) -> None:
    assert round(1e6 / shortest_us(sensors, baud, filtered=filtered)) == rate_hz


def test_a_record_is_digitised_then_sent_its_status_byte_too() -> None:
    assert digitising_us(18) == 4500.0
    assert sending_us(20, 9600) == 20 * 10 * 1e6 / 9600
    assert shortest_us(18, 9600, status=True) == digitising_us(18) + sending_us(21, 9600)
