"""The wire's arithmetic, against figures worked out by hand from the chips' data sheets."""

import pytest
from msgspec.structs import replace

from thenar.drivers.i2c.chips import CHIPS
from thenar.runtime.harness.wiring import GloveWiring, Harness
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import free_us, glove_us, port_us, row_us, scan_us, select_us

from ...gloves import behind
from .conftest import eight_chips


@pytest.mark.parametrize(
    ("clock_hz", "us", "free"), [(100_000, 480.0, 4.7), (400_000, 120.0, 1.3), (1_000_000, 48.0, 0.5)]
)
def test_a_reading_takes_its_scl_periods_and_the_bus_free_time(clock_hz: int, us: float, free: float) -> None:
    """How many periods the readings of each chip take is tested with the drivers."""
    found = next(each for each in CHIPS["mcp23017"].readings if each.name == "AB")
    assert free_us(clock_hz) == free
    assert port_us(found, clock_hz) == pytest.approx(us + free)


def test_selecting_a_channel_takes_twenty_scl_periods() -> None:
    assert select_us(100_000) == pytest.approx(204.7)
    assert select_us(400_000) == pytest.approx(51.3)


def test_eight_chips_take_what_the_sum_says() -> None:
    harness = eight_chips()
    time = scan_us(whole_scan(harness, harness.switches), harness)
    assert time.us == pytest.approx(8 * (120.0 + 1.3))
    assert time.us == time.full_us
    assert time.share == 1.0
    assert time.selects == 0


def test_a_few_kept_switches_take_their_share_of_all_that_are_wired() -> None:
    harness = eight_chips()
    time = scan_us(whole_scan(harness, ["s0", "s1", "s20", "s27"]), harness)
    assert time.us == pytest.approx(97.5 + 1.3 + 120.0 + 1.3)
    assert time.share == pytest.approx((98.8 + 121.3) / (8 * 121.3))


@pytest.mark.parametrize(
    ("places", "selects"),
    [
        ((None, None), 0),
        ((None, (0x70, 1)), 0),
        (((0x70, 1), (0x70, 1)), 0),
        (((0x70, 1), None, (0x70, 2)), 2),
        (((0x70, 1), (0x70, 2), (0x70, 1)), 2),
        (((0x70, 1), (0x71, 1)), 4),
        (((0x70, 1), (0x70, 2), (0x71, 1)), 5),
    ],
)
def test_channels_are_selected_once_a_scan_and_another_mux_is_left_first(
    places: tuple[tuple[int, int] | None, ...], selects: int
) -> None:
    harness = behind(*places)
    time = scan_us(whole_scan(harness, harness.switches), harness)
    assert time.selects == selects
    assert time.us == pytest.approx(selects * 51.3 + len(places) * (97.5 + 1.3))


def test_each_bus_has_its_own_clock() -> None:
    (bus,) = behind(None).buses
    slow = replace(bus, device="e", clock_hz=100_000, chips=(replace(bus.chips[0], pins={"P00": "t"}),))
    harness = Harness(name="x", buses=(bus, slow))
    time = scan_us(whole_scan(harness, harness.switches), harness)
    assert time.us == pytest.approx(98.8 + 394.7)


def test_nothing_to_read_takes_no_time() -> None:
    harness = Harness(name="x")
    time = scan_us(whole_scan(harness, ()), harness)
    assert (time.us, time.full_us, time.share) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("switches", "bits"), [(1, "1"), (8, "FF"), (9, "1FF"), (0, "")])
def test_a_row_takes_what_its_bytes_take(switches: int, bits: str) -> None:
    row = f"$row,65535,4294967295,{bits},65535,65535*00\r\n"
    assert row_us(switches, 2, 115_200) == pytest.approx(len(row) * 10 / 115_200 * 1e6)


def test_a_cyberglove_is_as_fast_as_its_line_and_its_digitising_allow() -> None:
    glove = GloveWiring(port="p", baud=38_400)
    assert glove_us(glove, 18) == pytest.approx(18 * 250.0 + 21 * 10 / 38_400 * 1e6)
    assert glove_us(GloveWiring(port="p"), 22) == pytest.approx(22 * 250.0 + 25 * 10 / 115_200 * 1e6)
