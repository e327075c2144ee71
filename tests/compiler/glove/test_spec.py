"""What a spec decides: wiring, expectations, remarks; and what cannot be described."""

import pytest
from msgspec.structs import replace

from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.glove.spec import glove_spec
from thenar.compiler.hand import HandShape
from thenar.drivers.i2c.chips import expanders
from thenar.runtime.errors import BuildError, HarnessError
from thenar.runtime.harness.wiring import GloveWiring, Harness, StreamWiring
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us

from .conftest import manifest_of


def test_without_a_harness_one_is_proposed_with_a_cyberglove_for_joints() -> None:
    names = ["a", "b"]
    with_joints, without = (glove_spec(manifest_of(names, joints=joints)) for joints in (True, False))
    assert with_joints.summary.proposed
    assert without.harness == propose_harness(names)
    assert with_joints.harness.cyberglove == GloveWiring(port="/dev/ttyUSB0")
    read = with_joints.summary.expected.sensors
    assert with_joints.summary.expected.glove_us == pytest.approx(250.0 * read + (read + 3) * 10e6 / 115_200)
    assert without.summary.expected.glove_us is None


def test_the_scan_takes_what_the_wire_takes() -> None:
    names = [f"s{number}" for number in range(20)]
    harness = propose_harness([*names, "spare"], "pca9555")
    expected = glove_spec(manifest_of(names), None, harness).summary.expected
    time = scan_us(whole_scan(harness, names), harness)
    assert (expected.transactions, expected.scan_us, expected.full_us) == (2, time.us, time.full_us)
    assert expected.scan_us == pytest.approx(121.3 + 98.8, abs=0.1)
    assert expected.rates == manifest_of(names).rates


def test_a_board_with_kept_switches_takes_from_row_to_row() -> None:
    idle = StreamWiring(port="/dev/ttyACM1", switches=("x",))
    board = StreamWiring(port="/dev/ttyACM0", switches=("a",), rate_hz=200.0)
    expected = glove_spec(manifest_of(["a"]), None, Harness(name="h", streams=(idle, board))).summary.expected
    assert (expected.transactions, expected.rows_us) == (0, (5000,))


def test_a_build_without_switches_has_no_glove() -> None:
    with pytest.raises(BuildError, match="keeps no switch"):
        glove_spec(manifest_of([]))


def test_a_build_for_a_wiring_needs_a_harness() -> None:
    harness = propose_harness(["a", "b"])
    scan = whole_scan(harness, ["a"])
    assert glove_spec(manifest_of(["a"]), scan, harness).scan == scan
    with pytest.raises(BuildError, match="compiled for a specific wiring"):
        glove_spec(manifest_of(["a"]), scan)
    other = propose_harness(["b", "a"])
    assert glove_spec(manifest_of(["a"]), scan, other).scan == whole_scan(other, ["a"]) != scan


def test_a_harness_without_a_kept_switch_is_refused() -> None:
    with pytest.raises(HarnessError, match="no pin or column for b, which"):
        glove_spec(manifest_of(["a", "b"]), None, propose_harness(["a"]))


@pytest.mark.parametrize("path", ["/home/anna/anna.toml", "anna.toml", "C:\\gloves\\anna.toml"])
def test_the_calibrations_folder_stays_out_of_the_spec(path: str) -> None:
    glove = GloveWiring(port="/dev/ttyUSB0", calibration=path)
    harness = replace(propose_harness(["a"]), cyberglove=glove)
    written = glove_spec(manifest_of(["a"]), None, harness).harness
    assert written == replace(harness, cyberglove=replace(glove, calibration="anna.toml"))
    assert written.buses == harness.buses


def test_cables_of_an_existing_glove_that_are_not_read_are_told() -> None:
    range_ = (0.0, 1023.0)
    stream = StreamWiring(port="/dev/ttyACM0", switches=("c",), taxels={"pad": range_}, joints={"flex": range_})
    harness = replace(propose_harness(["a", "b"]), streams=(stream,))
    remarks = glove_spec(manifest_of(["a", "c"]), None, harness).summary.remarks
    assert "not read, so that its cable can be pulled without soldering: b, pad, flex" in remarks
    assert not [said for said in glove_spec(manifest_of(["a", "b"])).summary.remarks if "not read" in said]


def test_switches_closer_than_their_bodies_are_told(hand: HandShape) -> None:
    names = ["index_distal_2", "index_distal_4", "palm_heel_6"]
    assert glove_spec(manifest_of(names), hand=hand).summary.remarks == ()
    small = glove_spec(manifest_of(names), hand=hand.scaled(150.0)).summary.remarks
    assert len(small) == 1
    assert small[0].startswith("SW1 and SW2 are 3.")
    assert small[0].endswith("their bodies 4.9 mm wide: move one of them aside")


def test_a_strange_glove_is_described_without_places(hand: HandShape) -> None:
    summary = glove_spec(manifest_of(["index_distal_2", "mine"]), hand=hand).summary
    assert summary.hand_length_mm is None
    assert {(s.part, s.side, s.x_mm, s.y_mm) for s in summary.sensors} == {(None, None, None, None)}
    assert summary.remarks[-1].startswith("the positions of this glove's sensors are unknown")


@pytest.mark.parametrize("kind", sorted(expanders()))
def test_the_bill_counts_what_the_circuit_holds(hand: HandShape, kind: str) -> None:
    names = hand.names[:30]
    spec = glove_spec(manifest_of(names), None, propose_harness(names, kind), hand)
    *pieces, joint = [line for line in spec.summary.materials if line.unit == "pcs"]
    assert (joint.quantity, joint.designators) == (1, ("thumb_mpj",))
    assert sorted(ref for line in pieces for ref in line.designators) == sorted(c.ref for c in spec.circuit.components)
    assert all(line.quantity == len(line.designators) for line in pieces)
    (switches,) = [line for line in pieces if line.part == "EVQPLDA15"]
    assert (switches.quantity, switches.maker) == (30, "Panasonic")
    chips = [line for line in pieces if line.designators[0] == "U1"]
    assert [line.quantity for line in chips] == [len(spec.summary.readers)]
    wire = sum(line.quantity for line in spec.summary.materials if line.unit == "m")
    assert wire * 1000 == pytest.approx(sum(each.length_mm or 0 for each in spec.summary.wires))
