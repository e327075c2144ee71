from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.i2c.bus import I2cBus, PlacedPort, cut
from thenar.drivers.i2c.chips import CHIPS, Reading
from thenar.drivers.i2c.node import MOST_MESSAGES, BatchMode
from thenar.drivers.i2c.supervisor import PlacedChip, Route

MakeRig = Callable[..., Any]
NEVER_CHECKED = 3600.0

EVERY_KIND = [
    ("mcp23017", 0x20),
    ("mcp23008", 0x21),
    ("tca6424a", 0x22),
    ("pcf8574", 0x23),
    ("pcf8575", 0x24),
    ("pca9555", 0x25),
    ("tca9555", 0x26),
    ("pcf8574a", 0x38),
]
WHOLE = ["AB", "GPIO", "012", "P", "P", "01", "01", "P"]
LEVELS = [0xA57E | 0x8080, 0xD3, 0x5AC396, 0x6D, 0x3CE1, 0x9B2D, 0x72C4, 0x1F]


@pytest.mark.parametrize("adapter", ["any", "i2c-gpio", "designware", "bcm2835"])
def test_every_kind_is_read_pin_by_pin_through_the_kernels_interface(rig: MakeRig, adapter: str) -> None:
    glove = rig(*EVERY_KIND, adapter=adapter)
    glove.emulated.set_all([LEVELS])
    glove.client.ask("prepare", list(enumerate(WHOLE)))
    assert glove.client.ask("read") == LEVELS
    assert all(chip.present and not chip.errors for chip in glove.client.state().chips)


# Transfers of one scan: three MCP23017 of which one is read by both ports apart, then two chips on two mux channels.
MIXED = [
    ("mcp23017", 0x20),
    ("mcp23017", 0x21),
    ("mcp23017", 0x22),
    ("mcp23017", 0x24, 0x70, 1),
    ("pca9555", 0x24, 0x70, 6),
]
PORTS = [(0, "A"), (0, "B"), (1, "AB"), (2, "B"), (3, "AB"), (4, "01")]


@pytest.mark.parametrize(
    ("adapter", "way", "transfers"),
    [
        ("any", "all ports between two mux switches in one transfer", 1 + 2 + 2),
        ("i2c-gpio", "all ports between two mux switches in one transfer", 1 + 2 + 2),
        ("designware", "all ports of a chip in one transfer", 3 + 2 + 2),
        ("bcm2835", "one transfer per port", 4 + 2 + 2),
    ],
)
def test_the_best_batch_that_the_adapter_takes_is_found_and_used(
    rig: MakeRig, adapter: str, way: str, transfers: int
) -> None:
    glove = rig(*MIXED, adapter=adapter, check_every_s=NEVER_CHECKED)
    glove.client.ask("prepare", PORTS)
    glove.client.ask("read")
    before = glove.emulated.counters(0)
    assert None not in glove.client.ask("read")
    after = glove.emulated.counters(0)
    assert glove.client.state().way == way
    assert after.transfers - before.transfers == transfers
    assert after.calls - before.calls == transfers


@pytest.mark.parametrize("adapter", ["any", "designware", "bcm2835"])
def test_a_scan_puts_only_readings_and_selects_on_the_wire(rig: MakeRig, adapter: str) -> None:
    glove = rig(*MIXED, adapter=adapter, check_every_s=NEVER_CHECKED)
    ports = [
        (0, "B"),
        (2, "AB"),
        (3, "A"),
        (4, "01"),
    ]  # chip 1, and ports A of chip 0 and B of chip 3, are not selected
    glove.client.ask("prepare", ports)
    glove.client.ask("read")
    before = glove.traffic()
    scans = 5
    for _ in range(scans):
        glove.client.ask("read")
    seen = {place: count - before.get(place, 0) for place, count in glove.traffic().items()}
    assert {place: count / scans for place, count in seen.items() if count} == {
        (0x20, None, None, 0x13): 4,
        (0x22, None, None, 0x12): 5,
        (0x70, None, None, None): 2 + 2,
        (0x24, 0x70, 1, 0x12): 4,
        (0x24, 0x70, 6, 0x00): 5,
    }


def test_unselected_chips_are_checked_but_no_port_of_theirs_is_ever_read(rig: MakeRig) -> None:
    glove = rig(*MIXED, check_every_s=0.02)
    glove.client.ask("prepare", [(1, "A")])
    glove.client.ask("read_until", [], 0.5)
    ports = {(place[0], place[3]) for place in glove.traffic() if place[3] in (0x12, 0x13) and place[0] != 0x24}
    assert ports == {(0x21, 0x12)}


def test_a_channel_is_selected_only_when_it_changes(rig: MakeRig) -> None:
    glove = rig(("mcp23017", 0x20, 0x70, 3), ("mcp23017", 0x21, 0x70, 3), check_every_s=NEVER_CHECKED)
    glove.client.ask("prepare", [(0, "A"), (1, "A")])
    glove.client.ask("read")
    before = glove.traffic()
    glove.client.ask("read")
    assert glove.traffic()[0x70, None, None, None] == before[0x70, None, None, None]


def test_chips_of_one_address_behind_two_muxes_are_kept_apart(rig: MakeRig) -> None:
    glove = rig(("mcp23017", 0x20, 0x70, 3), ("mcp23017", 0x20, 0x71, 3), ("mcp23017", 0x20, 0x71, 4))
    levels = [0x80F1, 0x9F80, 0xC0D3]
    glove.emulated.set_all([levels])
    glove.client.ask("prepare", [(1, "AB"), (0, "AB"), (2, "AB"), (1, "AB")])
    assert glove.client.ask("read") == [levels[1], levels[0], levels[2], levels[1]]


def test_more_ports_than_the_kernel_takes_messages_are_read_in_two_transfers(rig: MakeRig) -> None:
    glove = rig(*(("mcp23017", 0x20 + n) for n in range(8)), check_every_s=NEVER_CHECKED)
    ports = [(chip, port) for chip in range(8) for port in ("A", "B", "AB")]  # 24 ports, 48 messages
    glove.client.ask("prepare", ports)
    before = glove.emulated.counters(0).calls
    assert None not in glove.client.ask("read")
    assert glove.emulated.counters(0).calls - before == 2


def test_two_chips_that_would_answer_at_one_address_are_refused() -> None:
    def at(route: Route | None = None) -> PlacedChip:
        return PlacedChip(CHIPS["mcp23017"], 0x20, frozenset({0}), route)

    for chips in ([at(), at()], [at(), at(Route(0x70, 1))], [at(Route(0x70, 1)), at(Route(0x70, 1))]):
        with pytest.raises(SettingError, match="two chips would respond at 0x20"):
            I2cBus("/dev/i2c-7", chips)
    for route in (Route(0x60, 1), Route(0x70, 8)):
        with pytest.raises(SettingError, match="a tca9548a is at 0x70 to 0x77"):
            I2cBus("/dev/i2c-7", [at(route)])


def test_a_missing_or_wrong_bus_says_what_to_check() -> None:
    with pytest.raises(DeviceError, match=r"/dev/i2c-99 cannot be opened: there is no such bus.*plugged in"):
        I2cBus("/dev/i2c-99", []).open()
    with pytest.raises(DeviceError, match="is it an I2C device"):
        I2cBus("/dev/null", []).open()
    with pytest.raises(SettingError, match="is not the path of a device"):
        I2cBus("spy:///dev/i2c-1", [])


def test_a_file_is_no_bus_and_is_not_even_opened(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"kept")
    file.chmod(0)  # opening it would be refused, but for root
    before = file.stat()
    with pytest.raises(DeviceError, match="file is a file, not a device: it was left as it is"):
        I2cBus(str(file), []).open()
    assert file.stat() == before


def test_a_bus_that_was_not_opened_or_was_closed_says_so(rig: MakeRig) -> None:
    chip = PlacedChip(CHIPS["mcp23017"], 0x20, frozenset())
    scan = I2cBus("/dev/i2c-7", [chip]).prepare([PlacedPort(chip, chip.chip.readings[0])])
    with pytest.raises(DeviceError, match="is not open"):
        scan.read()
    glove = rig(("mcp23017", 0x20))
    glove.client.ask("prepare", [(0, "A")])
    glove.client.ask("close")
    assert "is not open" in glove.client.fails("read")
    glove.client.ask("open")
    assert glove.client.ask("read") == [0xFF]


MEMBERS = [
    PlacedChip(CHIPS["mcp23017"], 0x20 + n % 4, frozenset(), route, present=n != 3)
    for n, route in enumerate([None, None, None, None, Route(0x70, 1), Route(0x70, 1), Route(0x70, 2)])
]
ports = st.lists(
    st.builds(
        lambda member, command: PlacedPort(member, Reading("", command, (-1,) * 8)),
        st.sampled_from(MEMBERS),
        st.sampled_from([b"", b"\x12"]),
    ),
    max_size=60,
)


@pytest.mark.parametrize("way", BatchMode)
@given(ports=ports)
def test_groups_hold_each_present_port_once_in_order(way: BatchMode, ports: list[PlacedPort]) -> None:
    numbers = [number for _, group in cut(ports, way) for number, _ in group]
    assert numbers == [number for number, port in enumerate(ports) if port.member.present]
    assert all(ports[number] is port for _, group in cut(ports, way) for number, port in group)


@pytest.mark.parametrize("way", BatchMode)
@given(ports=ports)
def test_no_group_asks_more_than_its_way_allows(way: BatchMode, ports: list[PlacedPort]) -> None:
    for route, group in cut(ports, way):
        members = {id(port.member) for _, port in group}
        assert {port.member.route for _, port in group} == {route}
        assert sum(port.query.messages for _, port in group) <= MOST_MESSAGES
        assert len(members) == 1 or way is BatchMode.CHANNEL
        assert len(group) == 1 or way in (BatchMode.CHANNEL, BatchMode.CHIP)
