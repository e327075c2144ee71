"""The netlist, read again: every kept switch reaches one input, the one of glove.toml, and the scan map reads it."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.compiler.glove.files import spec_files
from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.glove.spec import glove_spec
from thenar.compiler.hand import HandShape
from thenar.drivers.i2c.chips import CHIPS, expanders
from thenar.runtime.harness.loading import load_harness, parse_harness
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, MuxChannel, StreamWiring
from thenar.runtime.manifest import Calibration, Switch, Threshold
from thenar.runtime.scanning.ports import whole_scan

from .conftest import manifest_of, read_netlist

if TYPE_CHECKING:
    from .conftest import Netlist


def reached(netlist: "Netlist", number: int, kind: str = "SW") -> list[tuple[str, str]]:
    """Return (designator, name of the pin) of what reads contact 1 of a sensor."""
    nodes = netlist.nets[netlist.net_of(f"{kind}{number}", "1")]
    readers = [(ref, pin) for ref, pin in nodes if ref[0] in "UA"]
    return [(ref, netlist.pin_names[netlist.components[ref]["part"], pin]) for ref, pin in readers]


def check(netlist: "Netlist", harness: Harness, names: tuple[str, ...]) -> None:
    """Check that the netlist connects the switches called `names` as the harness of expanders says."""
    chips = [chip for bus in harness.buses for chip in bus.chips if set(chip.pins.values()) & set(names)]
    wired = {name: (f"U{n}", pin) for n, chip in enumerate(chips, start=1) for pin, name in chip.pins.items()}
    for number, name in enumerate(names, start=1):
        assert reached(netlist, number) == [wired[name]]
    nodes = [node for net in netlist.nets.values() for node in net]
    assert len(nodes) == len(set(nodes)), "a pin on two nets"
    for number, chip in enumerate(chips, start=1):
        check_address(netlist, f"U{number}", chip)


def check_address(netlist: "Netlist", ref: str, chip: ChipWiring) -> None:
    lowest = min(chip.chip.addresses)
    straps = [name for name, _ in chip.chip.package.selects(0)]
    levels = [netlist.net_of(ref, netlist.pin_of(ref, name)) for name in straps]
    assert set(levels) <= {"VCC", "GND"}
    assert lowest + sum(1 << bit for bit, net in enumerate(levels) if net == "VCC") == chip.address


@settings(deadline=None, max_examples=25)
@given(kind=st.sampled_from(sorted(expanders())), data=st.data())
def test_every_kept_switch_reaches_one_input_and_the_scan_map_reads_it(
    hand: HandShape, kind: str, data: st.DataObject
) -> None:
    names = tuple(data.draw(st.lists(st.sampled_from(hand.names), min_size=1, max_size=40, unique=True)))
    spare = [f"spare {number}" for number in range(data.draw(st.integers(0, 20)))]
    order = data.draw(st.permutations([*names, *spare]))
    harness = propose_harness(order, kind)
    files = spec_files(manifest_of(names), None, harness, hand)
    check(read_netlist(files["glove.net"]), harness, names)
    loaded = parse_harness(files["glove.toml"].decode(), "glove.toml")
    assert loaded == harness
    assert sorted(whole_scan(loaded, names).switches) == list(range(len(names)))
    assert glove_spec(manifest_of(names), None, harness, hand).scan == whole_scan(loaded, names)


def test_a_proposed_glove_of_all_switches_is_wired_and_read(hand: HandShape, tmp_path: Path) -> None:
    files = spec_files(manifest_of(hand.names), hand=hand)
    (tmp_path / "glove.toml").write_bytes(files["glove.toml"])
    loaded = load_harness(tmp_path / "glove.toml")
    netlist = read_netlist(files["glove.net"])
    check(netlist, loaded, hand.names)
    assert sorted(whole_scan(loaded, hand.names).switches) == list(range(160))
    assert netlist.off_board == {f"SW{number}" for number in range(1, 161)}
    assert all(each["footprint"].count(":") == 1 for each in netlist.components.values())


def test_chips_behind_a_mux_use_its_channels_wires_with_pull_ups() -> None:
    near = ChipWiring(kind="pca9555", address=0x21, pins={"P00": "a"})
    far = ChipWiring(kind="mcp23017", address=0x20, mux=MuxChannel(address=0x71, channel=3), pins={"GPB2": "b"})
    harness = Harness(name="h", buses=(BusWiring(device="/dev/i2c-1", clock_hz=400_000, chips=(near, far)),))
    netlist = read_netlist(spec_files(manifest_of(["a", "b"]), None, harness)["glove.net"])
    mux = next(ref for ref, each in netlist.components.items() if each["value"] == "TCA9548APWR")
    check(netlist, harness, ("a", "b"))
    for chip, wire in (("SDA", "SD3"), ("SCL", "SC3")):
        net = netlist.net_of("U2", netlist.pin_of("U2", chip))
        assert net == netlist.net_of(mux, netlist.pin_of(mux, wire))
        upstream = netlist.net_of("U1", netlist.pin_of("U1", chip))
        assert upstream == netlist.net_of(mux, netlist.pin_of(mux, chip)) != net
        for each in (net, upstream):
            (pull,) = [ref for ref, _ in netlist.nets[each] if ref[0] == "R"]
            assert netlist.components[pull]["value"] == "2k2"
            assert netlist.net_of(pull, "1") == "VCC"
    assert netlist.net_of(mux, netlist.pin_of(mux, "A0")) == "VCC"
    assert netlist.net_of(mux, netlist.pin_of(mux, "A1")) == "GND"


@pytest.mark.parametrize(
    ("kind", "closed", "other", "pull", "far"),
    [
        ("mcp23017", "low", "GND", "", ""),
        ("mcp23017", "high", "VCC", "4k7", "GND"),
        ("tca6424a", "low", "GND", "10k", "VCC"),
        ("tca6424a", "high", "VCC", "4k7", "GND"),
    ],
)
def test_an_input_has_the_resistor_that_its_chip_lacks(
    kind: str, closed: Literal["low", "high"], other: str, pull: str, far: str
) -> None:
    pin = CHIPS[kind].pins[0]
    chip = ChipWiring(kind=kind, address=0x22, pins={pin: "a"}, closed=closed)
    harness = Harness(name="h", buses=(BusWiring(device="/dev/i2c-1", chips=(chip,)),))
    netlist = read_netlist(spec_files(manifest_of(["a"]), None, harness)["glove.net"])
    assert netlist.net_of("SW1", "2") == other
    resistors = [ref for ref, _ in netlist.nets[netlist.net_of("SW1", "1")] if ref[0] == "R"]
    assert [netlist.components[ref]["value"] for ref in resistors] == [pull] * bool(pull)
    assert [netlist.net_of(ref, "2") for ref in resistors if far == "GND"] == [far] * (far == "GND")
    assert [netlist.net_of(ref, "2") for ref in resistors if far == "VCC"] == [far] * (far == "VCC")


def test_unused_inputs_of_a_chip_without_pull_ups_do_not_float() -> None:
    netlist = read_netlist(spec_files(manifest_of(["a"]), None, propose_harness(["a"], "tca6424a"))["glove.net"])
    for pin in CHIPS["tca6424a"].pins[1:]:
        assert netlist.net_of("U1", netlist.pin_of("U1", pin)) == "GND"


def test_every_supply_pin_has_its_capacitor() -> None:
    netlist = read_netlist(spec_files(manifest_of(["a"]), None, propose_harness(["a"], "tca6424a"))["glove.net"])
    values = [each["value"] for ref, each in netlist.components.items() if ref[0] == "C"]
    assert sorted(values) == ["100n", "100n", "10u"]
    for ref in (ref for ref in netlist.components if ref[0] == "C"):
        assert {netlist.net_of(ref, "1"), netlist.net_of(ref, "2")} == {"VCC", "GND"}


def test_names_that_mean_something_to_the_netlist_are_only_names() -> None:
    names = ("GND", "VCC", 'a "quoted" (one)', "back\\slash", "ß 指", "SDA0")
    harness = propose_harness(names)
    netlist = read_netlist(spec_files(manifest_of(names), None, harness)["glove.net"])
    check(netlist, harness, names)
    assert {netlist.net_of(f"SW{number}", "2") for number in range(1, 7)} == {"GND"}
    assert [netlist.net_of(f"SW{number}", "1") for number in range(1, 7)] == [f"/{name}" for name in names]


def test_every_wire_of_the_list_is_on_the_net_of_its_switches(hand: HandShape) -> None:
    names = hand.names[:50]
    summary = glove_spec(manifest_of(names), hand=hand).summary
    netlist = read_netlist(spec_files(manifest_of(names), hand=hand)["glove.net"])
    for wire in summary.wires:
        contact = "1" if wire.unit else "2"
        nets = {netlist.net_of(f"SW{number}", contact) for number in wire.switches}
        assert nets == {netlist.net_of(wire.connector, str(wire.pin))} == {wire.net}


def test_a_sender_has_pins_for_kept_columns_and_ground() -> None:
    board = StreamWiring(port="/dev/ttyACM0", switches=("x", "b", "a"))
    harness = Harness(name="h", streams=(board,))
    netlist = read_netlist(spec_files(manifest_of(["a", "b"]), None, harness)["glove.net"])
    assert reached(netlist, 1) == [("A1", "a")]
    assert reached(netlist, 2) == [("A1", "b")]
    assert netlist.net_of("A1", netlist.pin_of("A1", "GND")) == netlist.net_of("SW1", "2") == "GND"
    assert netlist.off_board == {"SW1", "SW2", "A1"}


_TAXELS = """
[[stream]]
port = "/dev/a"
switches = ["s0"]
taxels = { t0 = [0, 1023], t1 = [0, 1023] }
[stream.board]
pins = { s0 = "2", t0 = "A1", t1 = "A2" }

[[stream]]
port = "/dev/b"
taxels = { t2 = [0, 1023], spare = [0, 1023], t3 = [0, 1023] }
[stream.board]
pins = { t2 = "A0.0", spare = "A0.1", t3 = "A1.1" }
select = ["8", "9", "10", "11"]

[[bus]]
device = "/dev/i2c-1"
[[bus.chip]]
kind = "ads1115"
address = 0x4A
[bus.chip.pins]
AIN2 = "t4"
[[bus.chip]]
kind = "ads7828"
address = 0x49
mux = { address = 0x70, channel = 3 }
[bus.chip.pins]
CH7 = "t5"

[[spi]]
device = "/dev/spidev1.0"
kind = "mcp3008"
[spi.pins]
CH1 = "t6"
[[spi]]
device = "/dev/spidev1.1"
kind = "mcp3204"
[spi.pins]
CH3 = "t7"
"""


def test_every_taxel_is_half_a_divider_at_the_channel_that_measures_it() -> None:
    """Two levels of a taxel are one pad; t3 is on the second multiplexer, on its second channel."""
    harness = parse_harness(_TAXELS, "glove.toml")
    coded = Calibration(0, "t0", "N", 0, 0.0, 1000, 5.0)

    def level(taxel: str, code: int) -> Switch:
        return Switch(0, f"{taxel}>{code}", 0.1, Threshold(code, code / 200, replace(coded, name=taxel)))

    manifest = replace(
        manifest_of(["s0"]), switches=(Switch(0, "s0", 0.1), level("t0", 7), *(level(f"t{n}", 9) for n in range(8)))
    )
    spec = glove_spec(manifest, None, harness)
    assert [switch.name for switch in spec.summary.sensors] == ["s0", *(f"t{n}" for n in range(8))]
    netlist = read_netlist(spec_files(manifest, None, harness)["glove.net"])
    wanted = [
        *(("A1", "A1"), ("A1", "A2"), ("U5", "I0"), ("U6", "I1")),
        *(("U1", "AIN2"), ("U2", "CH7"), ("U3", "CH1"), ("U4", "CH3")),
    ]
    for number, channel in enumerate(wanted, start=2):
        assert reached(netlist, number, "PAD") == [channel]
        assert netlist.net_of(f"PAD{number}", "2") == "VCC"
        (divider,) = [ref for ref, _ in netlist.nets[netlist.net_of(f"PAD{number}", "1")] if ref[0] == "R"]
        assert netlist.net_of(divider, "2") == "GND"
    assert netlist.net_of("U1", netlist.pin_of("U1", "ADDR")) == "SDA0"
    assert {netlist.net_of(ref, netlist.pin_of(ref, "CS")) for ref in ("U3", "U4")} == {"CS1_0", "CS1_1"}
    for pin in ("S0", "S1", "S2", "S3"):
        (shared,) = {netlist.net_of(ref, netlist.pin_of(ref, pin)) for ref in ("U5", "U6")}
        assert "A2" in [ref for ref, _ in netlist.nets[shared]]
    commons = {netlist.net_of(ref, netlist.pin_of(ref, "COMMON")) for ref in ("U5", "U6")}
    assert len(commons) == 2
    assert all("A2" in [ref for ref, _ in netlist.nets[net]] for net in commons)
    nodes = [node for net in netlist.nets.values() for node in net]
    assert len(nodes) == len(set(nodes)), "a pin on two nets"
    assert [stream.levels for stream in spec.scan.streams] == [
        ((0, 7, 1), (0, 9, 2), (1, 9, 3)),
        ((0, 9, 4), (2, 9, 5)),
    ]
    assert [port.levels for port in spec.scan.ports] == [((9, 6 + n),) for n in range(4)]
    assert reached(netlist, 1) == [("A1", "2")]
    remarks = spec.summary.remarks
    assert remarks[-1] == "A2: S0 to S3 of its multiplexers go to 8, 9, 10, 11, their commons to A0, A1"
    (said,) = [remark for remark in spec.summary.remarks if "pad t0," in remark]
    assert said.startswith("PAD2 ")
    assert "codes above 7" in said
    assert "codes above 9" in said
