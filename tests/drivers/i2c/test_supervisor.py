import errno
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.emulated.i2c_wire import Adapter, Message, Station, Wire
from thenar.drivers.errors import DeviceError
from thenar.drivers.i2c.chips import CHIPS, Conversion, Converter, expanders
from thenar.drivers.i2c.node import DeviceNode, Query, Run
from thenar.drivers.i2c.supervisor import ChipSupervisor, PlacedChip, identify_chip, read_back, set_up


class DeadNode(DeviceNode):
    """An adapter that answers every transfer with one errno, until its node is gone too."""

    def __init__(self, code: int) -> None:
        super().__init__("/dev/i2c-7")
        self.code, self.gone = code, False

    def open(self) -> None:
        if self.gone:
            raise DeviceError(f"{self.device} cannot be opened")

    def claim(self, address: int) -> None:
        pass

    def write(self, address: int, data: bytes) -> None:
        raise OSError(self.code, "dead")

    def prepare(self, queries: Sequence[Query]) -> Run:
        raise OSError(self.code, "dead")


@pytest.mark.parametrize("code", [errno.EREMOTEIO, errno.ENXIO, errno.EIO, errno.ETIMEDOUT])
def test_a_gone_adapter_is_noticed_whatever_its_errno(code: int) -> None:
    node = DeadNode(code)
    chips = [PlacedChip(CHIPS["mcp23017"], address, frozenset()) for address in (0x20, 0x21)]
    keeper = ChipSupervisor(node, chips, check_every_s=1.0)
    keeper.begin()
    assert not any(chip.present for chip in chips)
    node.gone = True
    with pytest.raises(DeviceError, match="cannot be opened"):
        keeper.attend()


# Kinds that are told by their addresses or not at all: the same registers under two names.
ALIKE = {"tca9555": "pca9555", "pcf8574a": "pcf8574"}
PAIRS = [
    (said, there)
    for said in CHIPS
    for there in CHIPS
    if ALIKE.get(said, said) != ALIKE.get(there, there) and set(CHIPS[said].addresses) & set(CHIPS[there].addresses)
]


class WireNode(DeviceNode):
    """A node whose transfers go to an emulated wire in this process."""

    def __init__(self, kind: str, address: int) -> None:
        super().__init__("/dev/i2c-7")
        self.station = Station(CHIPS[kind].model, address)
        self.adapter = Adapter(Wire([self.station], 100_000), "any")

    def write(self, address: int, data: bytes) -> None:
        self.adapter.rdwr([Message(address, data)])

    def prepare(self, queries: Sequence[Query]) -> Run:
        messages = []
        for query in queries:
            messages += [Message(query.address, query.command)] if query.command else []
            messages.append(Message(query.address, None, query.length))
        return lambda: [
            answer for answer, message in zip(self.adapter.rdwr(messages), messages, strict=True) if not message.data
        ]


def address_of(*kinds: str) -> int:
    return min(set.intersection(*(set(CHIPS[kind].addresses) for kind in kinds)))


def node_with(kind: str, address: int, levels: int) -> WireNode:
    node = WireNode(kind, address)
    node.station.device.levels = levels & (1 << len(CHIPS[kind].pins)) - 1
    return node


def inputs(kind: str) -> frozenset[int]:
    chip = CHIPS[kind]
    return frozenset(pin for pin, name in enumerate(chip.pins) if name not in chip.not_inputs)


levels = st.integers(0, (1 << 24) - 1)
leftovers = st.lists(st.tuples(st.integers(0, 0x1A), st.integers(0, 255)), max_size=6)


@pytest.mark.parametrize("kind", expanders())
@given(levels=levels, leftovers=leftovers)
def test_every_reading_gives_the_pins_whatever_the_chip_was_left_with(
    kind: str, levels: int, leftovers: list[tuple[int, int]]
) -> None:
    chip, address = CHIPS[kind], address_of(kind)
    node = node_with(kind, address, levels)
    for register, value in leftovers:
        node.station.device.poke(register, value)
    set_up(node, chip, address, inputs(kind))
    for reading in chip.readings:
        answer = int.from_bytes(node.query(Query(address, reading.command, reading.length)), "little")
        seen = {pin: answer >> bit & 1 for bit, pin in enumerate(reading.pins)}
        assert all(seen[pin] == node.station.device.levels >> pin & 1 for pin in seen if pin in inputs(kind))


@pytest.mark.parametrize(("said", "there"), PAIRS)
@given(levels=levels)
def test_another_chip_is_found_out_unless_all_pins_are_low(said: str, there: str, levels: int) -> None:
    """Low pins read as driven low: where they all are, nobody could tell a chip without registers from others."""
    address = address_of(said, there)
    whole = (1 << len(CHIPS[there].pins)) - 1
    pins = levels & whole
    ports = [pins >> 8 * port & 0xFF for port in range(len(CHIPS[there].pins) // 8)]
    if not CHIPS[said].registers and not all(port & 0xF9 for port in ports):
        return
    assert not set_up(node_with(there, address, pins), CHIPS[said], address, inputs(said))


@pytest.mark.parametrize("there", sorted(set(expanders()) - set(ALIKE)))
def test_what_is_there_instead_is_named_and_its_pins_are_left_inputs(there: str) -> None:
    address = address_of(there, "tca6424a")  # all but a pcf8574a can be there
    node = node_with(there, address, 0xA5A5A5)
    assert identify_chip(node, address) == f"something that behaves like a {there}"
    reading = CHIPS[there].readings[-1]
    if reading.high:  # pull-ups are for pins in use: the direction register tells
        assert node.query(Query(address, b"\x00", 1)) == b"\xff"
    else:
        answer = node.query(Query(address, reading.command, reading.length))
        assert int.from_bytes(answer, "little") == node.station.device.levels


def test_what_is_nothing_known_is_called_so() -> None:
    assert identify_chip(WireNode("pcf8574", 0x21), 0x20) == "something unknown"


CONVERTERS = [kind for kind in CHIPS if kind not in expanders()]


@pytest.mark.parametrize("kind", CONVERTERS)
@given(channel=st.integers(0, 3), code=st.integers(0, 0xFFFF), leftovers=leftovers)
def test_conversions_give_their_channels_code_whatever_was_left(
    kind: str, channel: int, code: int, leftovers: list[tuple[int, int]]
) -> None:
    chip, address = CHIPS[kind], address_of(kind)
    assert isinstance(chip, Converter)
    node = WireNode(kind, address)
    node.station.device.levels = code << 16 * channel
    now = [0.0]
    node.station.device.clock = lambda: now[0]  # type: ignore[attr-defined]
    for register, value in leftovers:
        node.station.device.poke(register, value)
    set_up(node, chip, address, inputs(kind))
    for number, reading in enumerate(chip.readings):
        assert isinstance(reading, Conversion)
        if reading.start:
            node.write(address, reading.start)
        now[0] += reading.us / 1e6
        answer = node.query(Query(address, reading.command, reading.length))
        assert chip.code(answer) == (min(code, (1 << chip.bits) - 1) if number == channel else 0)


def test_a_conversion_takes_its_time_and_delays_the_next() -> None:
    chip, node, now = CHIPS["ads1115"], WireNode("ads1115", 0x48), [0.0]
    node.station.device.clock = lambda: now[0]  # type: ignore[attr-defined]
    node.station.device.levels = 1000 | 2000 << 16
    first, second = chip.readings[:2]
    assert isinstance(first, Conversion)
    assert isinstance(second, Conversion)
    node.write(0x48, first.start)
    node.write(0x48, second.start)  # it converts: this one is lost
    now[0] = 1e-3
    assert node.query(Query(0x48, first.command, 2)) == bytes(2)
    now[0] = first.us / 1e6
    assert node.query(Query(0x48, first.command, 2)) == (1000).to_bytes(2, "big")


@pytest.mark.parametrize("kind", CHIPS)
def test_a_harmful_reset_shows_in_the_watched_registers(kind: str) -> None:
    chip, address = CHIPS[kind], address_of(kind)
    node = node_with(kind, address, 0xFFFFFF)
    set_up(node, chip, address, inputs(kind))
    watch = chip.watched(inputs(kind))
    if watch is None or kind == "ads7828":
        assert not chip.registers  # all pins high is both its reset and its set-up
        return
    assert watch.holds(read_back(node, chip, address, watch))
    node.station.device.reset()
    assert not watch.holds(read_back(node, chip, address, watch))


def test_an_mcp23017_pulls_up_used_pins_and_its_outputs() -> None:
    node = node_with("mcp23017", 0x20, 0xFFFF)
    set_up(node, CHIPS["mcp23017"], 0x20, frozenset({0, 9}))
    assert node.query(Query(0x20, b"\x0c", 2)) == bytes((0x81, 0x82))


@pytest.mark.parametrize("kind", ["mcp23017", "mcp23008"])
def test_lost_pull_ups_show_in_the_bits_that_stay_high(kind: str) -> None:
    chip = CHIPS[kind]
    node = node_with(kind, 0x20, 0xFFFF)
    set_up(node, chip, 0x20, inputs(kind))
    for reading in chip.readings:
        query = Query(0x20, reading.command, reading.length)
        assert int.from_bytes(node.query(query), "little") & reading.high == reading.high
        assert {chip.pins[pin] for bit, pin in enumerate(reading.pins) if reading.high >> bit & 1} <= set(
            chip.not_inputs
        )
    node.station.device.reset()
    assert int.from_bytes(node.query(query), "little") & reading.high == 0
