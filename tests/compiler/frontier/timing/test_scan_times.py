import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.frontier.points import PointTime
from thenar.compiler.frontier.wirings import (
    BOARD,
    ReadingCost,
    ScanTimes,
    WiringOption,
    records_of,
    scan_times,
)
from thenar.drivers.cyberglove_protocol import SENSORS_18, SENSORS_22
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import GloveWiring
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.propose import propose_harness
from thenar.runtime.scanning.timing import row_us, scan_us

CALL = ReadingCost(each_us=7.0)
wired = st.builds(
    WiringOption, st.sampled_from(["mcp23017", "pca9555", "tca6424a", "pcf8575"]), st.sampled_from([100_000, 400_000])
)


def names_of(count: int) -> list[str]:
    return [f"s{number}" for number in range(count)]


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


def test_a_glove_that_was_measured_takes_that_and_fewer_sensors_in_proportion() -> None:
    records = records_of(
        SENSORS_18[:6], None, GloveWiring(port="/dev/x", record_us=2 * (18 * 250.0 + 21 * 10e6 / 115_200))
    )
    assert records.of(6).us == pytest.approx(2 * records_of(SENSORS_18).of(6).us)
    assert records.how == "measured"


def test_a_gloves_rate_is_limited_by_line_and_request() -> None:
    slow = records_of(SENSORS_18, None, GloveWiring(port="/dev/x", baud=38_400))
    assert slow.of(18).us == pytest.approx(18 * 250.0 + 21 * 10e6 / 38_400)
    asked = records_of(SENSORS_18, None, GloveWiring(port="/dev/x", rate_hz=100.0))
    assert asked.of(2).us == asked.of(18).us == 10_000.0


def test_a_firmware_that_sets_no_mask_waits_for_all_sensors() -> None:
    assert records_of(SENSORS_18[:4], masked=False).of(4) == records_of(SENSORS_18).of(18)
