from itertools import count, pairwise
from timeit import repeat

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.errors import SettingError
from thenar.runtime.sources.base import Debouncer

# EVQPL's data sheet: so long a contact bounces when it closes, and when it opens.
CLOSING_US, OPENING_US = 3_000, 8_000
RATES_HZ = [100, 125, 160, 200, 250, 400, 500, 999, 1000, 2000]
MANY = st.integers(0, (1 << 12) - 1)
READINGS = st.lists(st.tuples(st.integers(0, 15_000), MANY, MANY), max_size=60)


def bounces(start: int, longest: int, seed: int) -> list[tuple[int, int]]:
    """Return contact changes from `start` on: 2 to 10 more edges, none later than `longest`."""
    random = np.random.default_rng(seed)
    edges = np.sort(random.integers(1, longest + 1, 2 * int(random.integers(1, 6)))).tolist()
    return [(start + edge, number % 2) for number, edge in enumerate(edges)]


def contact(seed: int, taps: int) -> list[tuple[int, int]]:
    """Return (time, level) of a switch that is pressed so many times, 25 ms and more, with as much in between."""
    random, now, changes = np.random.default_rng(seed), 0, [(0, 0)]
    for tap in range(taps):
        now += int(random.integers(40_000, 90_000))
        changes += [(now, 1), *bounces(now, CLOSING_US, seed * 100 + tap)]
        now += int(random.integers(40_000, 90_000))
        changes += [(now, 0), *[(at, 1 - level) for at, level in bounces(now, OPENING_US, seed * 200 + tap)]]
    return changes


def level_at(changes: list[tuple[int, int]], time: int) -> int:
    return [level for at, level in changes if at <= time][-1]


def reported(scans: list[int], changes: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return (time, state) of every change that the debouncer reports of what the scans read."""
    debouncer = Debouncer()
    states = [(0, 0), *((time, debouncer.update(time, level_at(changes, time), 1)) for time in scans)]
    return [now for before, now in pairwise(states) if before[1] != now[1]]


def scan_times(rate_hz: int, seed: int, until: int) -> list[int]:
    """Return the times of scans of a rate, each up to a tenth of a period off, as a busy computer has them."""
    random, period = np.random.default_rng(seed), 1_000_000 / rate_hz
    start = float(random.uniform(0, period))
    return [int(start + n * period + random.uniform(-0.05, 0.05) * period) for n in range(1, int(until / period))]


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_bounce_within_specification_gives_one_press_and_one_release(rate_hz: int) -> None:
    for seed in range(40):
        changes = contact(seed, taps=3)
        seen = reported(scan_times(rate_hz, seed, changes[-1][0] + 60_000), changes)
        assert [state for _, state in seen] == [1, 0] * 3, seed


@given(st.integers(0, 10_000), st.sampled_from(RATES_HZ))
def test_presses_are_immediate_and_releases_wait_one_scan_at_most(seed: int, rate_hz: int) -> None:
    """Measured from the first reading of the press, and from the first reading after the last bounce.

    Of slow scans it never takes two.
    """
    changes = contact(seed, taps=1)
    scans = scan_times(rate_hz, seed, changes[-1][0] + 60_000)
    (pressed, _), (released, _) = reported(scans, changes)
    assert pressed == next(time for time in scans if level_at(changes, time))
    closed = [time for time in scans if level_at(changes, time)]
    rested = next(time for time in scans if time > closed[-1])
    assert max((time for time in scans if time < released), default=0) < rested + 10_000
    if rate_hz <= 160:  # more than half of 10 ms from scan to scan
        assert sum(rested <= time < released for time in scans) < 2


@given(READINGS, st.integers(0, 11))
def test_every_switch_goes_through_as_if_it_were_alone(readings: list[tuple[int, int, int]], switch: int) -> None:
    together, alone, now = Debouncer(), Debouncer(), 0
    for passed, closed, known in readings:
        now += passed
        state = together.update(now, closed, known)
        assert state >> switch & 1 == alone.update(now, closed >> switch & 1, known >> switch & 1)


def model(readings: list[tuple[int, int, int]], press: int, release: int) -> list[int]:
    """Return the states of one switch by the same rules, one at a time; readings as (time, level, known)."""
    state, locked_until, opening, period, last, states = 0, -1, None, None, None, []
    read = 0
    for time, level, known in readings:
        if known and time - read > 2 * max(press, release):
            state, locked_until, opening = 0, -1, None
        read = time if known else read
        interval = 0 if last is None else time - last
        last = time
        if interval:
            period = interval if period is None else min(interval, period + period // 4 + 1)
        if known and time >= locked_until:
            if level:
                opening = None
                if not state:
                    state, locked_until = 1, time + press
            elif state:
                opening = time if opening is None else opening
                if time + (period or 0) >= opening + release:
                    state, locked_until, opening = 0, opening + release, None
        states.append(state)
    return states


@given(
    st.lists(st.tuples(st.integers(0, 6_000), st.integers(0, 1), st.integers(0, 1)), max_size=80),
    st.integers(0, 12_000),
    st.integers(0, 12_000),
)
def test_it_does_what_the_rules_say_one_switch_at_a_time(
    steps: list[tuple[int, int, int]], press: int, release: int
) -> None:
    times = np.cumsum([step[0] for step in steps]).tolist()
    readings = [(time, level, known) for time, (_, level, known) in zip(times, steps, strict=True)]
    debouncer = Debouncer(press, release)
    assert [debouncer.update(*reading) for reading in readings] == model(readings, press, release)


def test_time_that_goes_back_stands_still() -> None:
    debouncer = Debouncer()
    for time in range(0, 20_000, 1000):
        debouncer.update(time, 1, 1)
    assert debouncer.update(20_000, 0, 1) == 1
    assert debouncer.update(5, 0, 1) == 1
    assert [debouncer.update(time, 0, 1) for time in range(21_000, 30_000, 1000)] == [1] * 8 + [0]


def test_4096_switches_at_once() -> None:
    debouncer, every = Debouncer(), (1 << 4096) - 1
    assert debouncer.update(0, every, every) == every
    states = [debouncer.update(10_000 + time * 1000, 1, every) for time in range(12)]
    assert states[-1] == 1
    assert debouncer.update(50_000, every, every) == every


def test_an_update_of_40_switches_takes_less_than_10_microseconds() -> None:
    """Half of them bounce all the time: more than a hand can do."""
    random, every = np.random.default_rng(1), (1 << 40) - 1
    closed = [int(word) & every for word in random.integers(0, 1 << 20, 1000)]
    debouncer, now = Debouncer(), count(0, 1000)

    def updates() -> None:
        for mask in closed:
            debouncer.update(next(now), mask, every)

    assert min(repeat(updates, number=1, repeat=20)) / len(closed) < 10e-6


@pytest.mark.parametrize("times", [(-1, 0), (0, -1)])
def test_negative_times_are_refused(times: tuple[int, int]) -> None:
    with pytest.raises(SettingError, match="0 or more"):
        Debouncer(*times)
