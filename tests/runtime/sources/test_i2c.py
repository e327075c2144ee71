"""What a device makes of the answers of its ports; that the ports are read is shown on real device nodes."""

from collections.abc import Sequence

import numpy as np
import pytest

from thenar.runtime.frames import SwitchFrame
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Debounce, Harness
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources import i2c as module
from thenar.runtime.sources.base import slowest_us, sources_of
from thenar.runtime.sources.i2c import I2cDevice

NAMES = tuple(f"s{number}" for number in range(6))
HIGH = 0xFF


class Bench:
    """A clock that only answers and sleep move, and the answers of two PCF8574 in the order of their requests."""

    def __init__(self) -> None:
        self.now = 1_000_000
        self.answers: list[list[int | None]] = []
        self.takes_us = 100

    def sleep(self, seconds: float) -> None:
        self.now += round(1e6 * seconds)

    def read(self) -> list[int | None]:
        self.now += self.takes_us
        return self.answers.pop(0)


class Bus:
    bench: Bench

    def __init__(self, *_: object, **__: object) -> None:
        pass

    def open(self) -> None:
        pass

    def prepare(self, _ports: Sequence[object]) -> Bench:
        return self.bench


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    bench = Bench()
    Bus.bench = bench
    monkeypatch.setattr(module, "I2cBus", Bus)
    monkeypatch.setattr(module, "now_us", lambda: bench.now)
    monkeypatch.setattr("time.monotonic", lambda: bench.now / 1e6)
    monkeypatch.setattr("time.sleep", bench.sleep)
    return bench


def harness(debounce: Debounce, rate_hz: float) -> Harness:
    chips = tuple(
        ChipWiring(kind="pcf8574", address=0x20 + chip, pins={f"P{pin}": NAMES[3 * chip + pin] for pin in range(3)})
        for chip in range(2)
    )
    bus = BusWiring(device="/dev/i2c-1", rate_hz=rate_hz, chips=chips)
    return Harness(name="two", buses=(bus,), debounce=debounce)


def device(debounce: Debounce, rate_hz: float = 200.0) -> I2cDevice:
    return I2cDevice(harness(debounce, rate_hz), 0, SCAN)


def frame(of: I2cDevice) -> SwitchFrame:
    of.open()
    found = of.read(0.1)
    assert found is not None
    return found


OFF = Debounce(enabled=False)
SCAN = whole_scan(harness(OFF, 200.0), NAMES)


def test_a_pin_that_is_pulled_down_is_a_closed_switch(bench: Bench) -> None:
    bench.answers = [[HIGH & ~0b001, HIGH & ~0b110]]
    assert frame(device(OFF)) == SwitchFrame(bench.now, 0b110_001)


def test_a_port_without_an_answer_is_lost_and_the_other_is_not(bench: Bench) -> None:
    bench.answers = [[None, HIGH & ~0b010]]
    assert frame(device(OFF)) == SwitchFrame(bench.now, 0b010_000, lost=0b000_111)


@pytest.mark.parametrize(("rate_hz", "scans"), [(200.0, 21), (50.0, 6), (0.5, 1)])
def test_a_bus_is_scanned_at_its_rate(bench: Bench, rate_hz: float, scans: int) -> None:
    made = device(OFF, rate_hz)
    made.open()
    bench.answers = [[None, None]] * 21
    began_us, read = bench.now, 0
    while bench.now < began_us + 100_000:
        read += made.read(0.1) is not None
    assert read == scans


@pytest.mark.parametrize(("rate_hz", "period_us"), [(200.0, 10_000), (50.0, 20_000), (0.5, 2_000_000)])
def test_a_slow_bus_is_expected_at_its_rate(bench: Bench, rate_hz: float, period_us: int) -> None:
    made = device(OFF, rate_hz)
    assert (made.period_us, made.longest_us) == (period_us, 2 * period_us)
    assert slowest_us(sources_of(harness(OFF, rate_hz), NAMES, SCAN)) == period_us


def test_a_late_scan_is_not_made_up_for(bench: Bench) -> None:
    made = device(OFF)
    made.open()
    bench.answers = [[HIGH, HIGH]] * 4
    times_us = []
    for stall_us in (0, 12_000, 0, 0):
        bench.now += stall_us
        assert made.read(0.1) is not None
        times_us.append(bench.now)
    assert np.diff(times_us).tolist() == [12_100, 5_000, 5_000]


def test_readings_before_a_stalled_bus_are_not_new(bench: Bench) -> None:
    bench.takes_us = 1_000_000
    bench.answers = [[HIGH & ~0b001, None]]
    assert frame(device(OFF)) == SwitchFrame(bench.now, 0, lost=0b111_111)


def test_bounce_within_a_scan_or_two_is_not_seen(bench: Bench) -> None:
    made = device(Debounce())
    bench.takes_us = 1000
    for closed in (1, 0, 1, 1, 1):
        bench.answers.append([HIGH & ~(0b001 * closed), HIGH])
    assert [frame(made).closed for _ in range(5)] == [1] * 5


@pytest.mark.parametrize("pause_us", [20_001, 60_000_000])
def test_after_a_pause_a_reading_counts_at_once(bench: Bench, pause_us: int) -> None:
    made = device(Debounce())
    bench.answers += [[HIGH & ~0b001, HIGH]] * 20
    bench.answers += [[HIGH, HIGH]]
    assert [frame(made).closed for _ in range(20)] == [1] * 20
    bench.now += pause_us
    assert frame(made).closed == 0


def measuring(debounce: Debounce) -> I2cDevice:
    """An expander's port and two taxels on an ADS7828, of which the second has two levels."""
    chips = (
        ChipWiring(kind="pcf8574", address=0x20, pins={"P0": "s0"}),
        ChipWiring(kind="ads7828", address=0x48, pins={"CH2": "t0", "CH5": "t1"}),
    )
    harness = Harness(name="x", buses=(BusWiring(device="/dev/i2c-1", chips=chips),), debounce=debounce)
    return I2cDevice(harness, 0, whole_scan(harness, ["t1>900", "s0", "t0>100", "t1>40"]))


@pytest.mark.parametrize(
    ("codes", "closed"),
    [((100, 40), 0), ((101, 41), 0b1100), ((4095, 900), 0b1100), ((0, 901), 0b1001), ((0, 4095), 0b1001)],
)
def test_levels_are_closed_above_their_codes_and_the_codes_go_along(
    bench: Bench, codes: tuple[int, int], closed: int
) -> None:
    bench.answers = [[HIGH, *codes]]
    assert frame(measuring(OFF)) == SwitchFrame(bench.now, closed, taxels=codes)


def test_a_failed_conversion_loses_its_levels_and_code(bench: Bench) -> None:
    made = measuring(OFF)
    bench.answers = [[HIGH & ~1, 500, None], [HIGH, None, None]]
    assert frame(made) == SwitchFrame(bench.now, 0b0110, lost=0b1001, taxels=(500, None))
    assert frame(made) == SwitchFrame(bench.now, 0, lost=0b1101)


def test_levels_are_debounced_as_switches_are(bench: Bench) -> None:
    made = measuring(Debounce())
    bench.takes_us = 1000
    bench.answers = [[HIGH, code, 0] for code in (101, 100, 101, 101, 101)]
    assert [frame(made).closed for _ in range(5)] == [0b100] * 5
