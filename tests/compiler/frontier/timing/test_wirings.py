import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.frontier.points import PointTime
from thenar.compiler.frontier.wirings import (
    AS_WIRED,
    BOARD,
    CLOCKS_HZ,
    ReadingCost,
    ScanTimes,
    WiringOption,
    records_of,
    scan_times,
    wirings,
)
from thenar.compiler.glove.propose import propose_board, propose_harness
from thenar.drivers.cyberglove_protocol import SENSORS_18, SENSORS_22
from thenar.drivers.i2c.chips import CHIPS
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.checks import faults
from thenar.runtime.harness.wiring import BoardWiring, GloveWiring, Harness, StreamWiring
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.timing import row_us, scan_us

from ...conftest import names_of

sizes = st.integers(1, 200)


@given(sizes, st.sampled_from([(), SENSORS_18, SENSORS_22, ("bend_1",)]))
def test_every_fitting_wiring_is_a_sound_harness_of_all_switches(size: int, joints: tuple[str, ...]) -> None:
    for wiring in wirings(None):
        if wiring.fits(names_of(size)):
            harness = wiring.harness_of(names_of(size), joints)
            assert not list(faults(harness))
            assert sorted(harness.switches) == sorted(names_of(size))
            assert (harness.cyberglove is not None) == (joints in (SENSORS_18, SENSORS_22))
            rates = [bus.clock_hz for bus in harness.buses] + [board.baud for board in harness.streams]
            assert rates == [wiring.clock_hz]


@given(st.integers(1, 112))
def test_a_board_reads_the_chips_of_every_fitting_avr_wiring(size: int) -> None:
    switches = tuple(names_of(size))
    for wiring in wirings(None, "avr328p"):
        if wiring.fits(switches):
            (bus,) = wiring.harness_of(switches).buses
            board = StreamWiring(port="/dev/ttyACM0", switches=switches, board=BoardWiring(chips=bus.chips))
            assert not list(faults(Harness(name="board", streams=(board,))))


def test_a_new_glove_tries_every_chip_at_every_clock() -> None:
    found = [(wiring.name, wiring.clock_hz) for wiring in wirings(None)]
    chips = [
        (kind, hz)
        for kind in ("mcp23017", "pcf8575", "pca9555", "tca6424a")
        for hz in CLOCKS_HZ
        if hz <= CHIPS[kind].clock_hz
    ]
    assert found == [*chips, (BOARD, 115_200), (BOARD, 1_000_000)]


def test_taxels_of_a_new_glove_hang_on_ads7828_spi_or_board() -> None:
    levels = ["pad0>3", "pad0>9", "pad1>9"]
    every = wirings(None, switches=False, taxels=True)
    assert {wiring.name for wiring in every} == {"ads7828", BOARD, "mcp3008", "mcp3208"}
    for wiring in every:
        fitting = not (wiring.name == "ads7828" and wiring.clock_hz > CHIPS["ads7828"].clock_hz)
        assert wiring.fits(levels) == fitting
        assert wiring.harness_of(levels).taxel_names == ("pad0", "pad1")
    both = wirings(None, taxels=True)
    assert all(wiring.fits(["s0", *levels]) for wiring in both if wiring.clock_hz <= 400_000)
    assert not any(wiring.fits(levels) for wiring in wirings(None, "avr2560", taxels=True))


def test_an_spi_of_a_raspberry_pi_selects_two_converters() -> None:
    levels = [f"pad{number}>9" for number in range(17)]
    assert WiringOption("mcp3208", 1_000_000).fits(levels[:16])
    assert not WiringOption("mcp3208", 1_000_000).fits(levels)


def test_the_given_harness_comes_first_and_stays_as_it_is() -> None:
    harness = propose_harness(names_of(20), "pca9555")
    first = wirings(harness)[0]
    assert (first.name, first.clock_hz) == (AS_WIRED, 400_000)
    assert first.harness_of(names_of(3)) is harness
    assert first.fits(names_of(20))
    assert not first.fits(names_of(21))


def test_the_clock_of_a_given_board_is_its_baud() -> None:
    assert wirings(propose_board(names_of(5)))[0].clock_hz == 1_000_000


@pytest.mark.parametrize(
    "harness",
    [
        propose_harness(names_of(20), "pcf8575"),
        propose_harness(names_of(160), "mcp23017"),
        propose_board(names_of(20)),
        WiringOption("mcp23017", 1_000_000).harness_of(names_of(20)),
        Harness(name="empty"),
    ],
    ids=["no registers", "mux", "board", "1 MHz", "nothing"],
)
def test_an_avr_has_no_wiring_that_a_sketch_could_not_read(harness: Harness) -> None:
    assert AS_WIRED not in [wiring.name for wiring in wirings(harness, "avr2560")]


def test_an_avr_reads_the_given_chips_where_it_can() -> None:
    harness = propose_harness(names_of(20))
    assert wirings(harness, "avr2560")[0] == WiringOption(AS_WIRED, 400_000, harness)


def test_a_mux_slows_a_bus_down_or_there_is_no_room() -> None:
    fast = WiringOption("mcp23017", 1_000_000)
    assert fast.fits(names_of(112))
    with pytest.raises(HarnessError, match="TCA9548A"):
        fast.harness_of(names_of(113))
    with pytest.raises(HarnessError, match="channels a board's sketch cannot select"):
        WiringOption("mcp23017", 400_000, muxes=False).harness_of(names_of(113))
    assert not WiringOption("mcp23017", 100_000).fits(names_of(1000))


CALL = ReadingCost(each_us=7.0)
wired = st.builds(
    WiringOption, st.sampled_from(["mcp23017", "pca9555", "tca6424a", "pcf8575"]), st.sampled_from([100_000, 400_000])
)


@given(st.integers(1, 140), wired)
def test_scan_time_is_the_runtimes_prediction_with_a_call_per_transaction(switches: int, wiring: WiringOption) -> None:
    names = names_of(switches)
    times = scan_times(names, wiring, CALL)
    harness = wiring.harness_of(names)
    scan = plan_scan(names, harness)
    whole = scan_us(scan, harness)
    assert times.us == pytest.approx(whole.us + CALL.each_us * (len(scan.ports) + whole.selects))
    assert (times.ports, times.chips, times.how) == (len(scan.ports), len(harness.buses[0].chips), "wire")


@pytest.mark.parametrize(("switches", "baud", "hz"), [(33, 115_200, 200), (33, 1_000_000, 200), (200, 115_200, 149)])
def test_a_board_sends_200_rows_a_second_if_its_line_allows(switches: int, baud: int, hz: int) -> None:
    times = scan_times(names_of(switches), WiringOption(BOARD, baud))
    assert times == ScanTimes(BOARD, baud, float(round(1e6 / hz)), 1, 0, "wire")
    assert times.us >= row_us(switches, 0, baud)


def test_a_switch_without_a_place_is_an_error() -> None:
    wiring = WiringOption("as wired", 400_000, propose_harness(["s0"]))
    with pytest.raises(HarnessError, match="s1"):
        scan_times(names_of(2), wiring)


@pytest.mark.parametrize("joints", [SENSORS_18[:1], SENSORS_18, SENSORS_22[::-1], ("index_dij",)])
@pytest.mark.parametrize("filtered", [None, True])
def test_a_record_is_the_vendors_formula_of_the_sensors_that_are_read(
    joints: tuple[str, ...], filtered: bool | None
) -> None:
    """Written out here: 0.25 ms a sensor, 0.1256 more with the filter; ten bits a byte; letter, status and end."""
    glove = GloveWiring(port="/dev/x", sensors=22 if "index_dij" in joints else None, filter=filtered)
    found = records_of(joints, None, glove).of(n := len(joints))
    assert found.us == pytest.approx(n * (375.6 if filtered else 250.0) + (n + 3) * 10e6 / 115_200)
    assert found.how == "formula"


def test_custom_joints_take_the_given_time_or_an_unknown_one() -> None:
    assert records_of(["bend_1", "thumb_mpj"]).of(2) == PointTime(0.0, "unknown")
    assert records_of(["bend_1", "bend_2"], 650.0).of(2) == PointTime(650.0, "given")
    assert records_of(["bend_1", "bend_2"], 650.0).of(1) == PointTime(325.0, "given")
    assert records_of(SENSORS_18, 650.0).of(18).us == pytest.approx(650.0)
    assert records_of([]).of(0) == records_of([], 650.0).of(0) == records_of(SENSORS_18).of(0) == PointTime(0.0, "wire")


def test_a_cyberglove_may_be_wired_under_other_names() -> None:
    names = tuple(f"bend_{number}" for number in range(18))
    assert records_of(names[:5], None, GloveWiring(port="/dev/x", joints=names)) == records_of(SENSORS_18)


def test_a_gloves_rate_is_limited_by_line_and_request() -> None:
    slow = records_of(SENSORS_18, None, GloveWiring(port="/dev/x", baud=38_400))
    assert slow.of(18).us == pytest.approx(18 * 250.0 + 21 * 10e6 / 38_400)
    asked = records_of(SENSORS_18, None, GloveWiring(port="/dev/x", rate_hz=100.0))
    assert asked.of(2).us == asked.of(18).us == 10_000.0


def test_a_firmware_that_sets_no_mask_waits_for_all_sensors() -> None:
    assert records_of(SENSORS_18[:4], masked=False).of(4) == records_of(SENSORS_18).of(18)
