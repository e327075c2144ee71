import errno

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.emulated.i2c_wire import (
    ADAPTERS,
    Adapter,
    Message,
    NakError,
    Station,
    Wire,
)
from thenar.drivers.i2c.chips import CHIPS


def write(address: int, *data: int) -> Message:
    return Message(address, bytes(data))


def read(address: int, length: int) -> Message:
    return Message(address, None, length)


def mcp(levels: int = 0xFFFF, mux: int | None = None, channel: int | None = None) -> Station:
    station = Station(CHIPS["mcp23017"].model, 0x20, mux, channel)
    station.device.levels = levels
    station.device.poke(0x0C, 0xFF)
    station.device.poke(0x0D, 0xFF)
    return station


def test_registers_follow_each_other_and_wrap_in_a_chip_after_reset() -> None:
    wire = Wire([Station(CHIPS["mcp23017"].model, 0x20)], 100_000)
    (answer,) = wire.transfer([write(0x20, 0x00), read(0x20, 24)])[1:]
    assert answer == b"\xff\xff" + bytes(20) + b"\xff\xff"


def test_without_sequence_the_pointer_stays_in_its_pair() -> None:
    station = mcp(0x1234)
    wire = Wire([station], 100_000)
    station.device.poke(0x0A, 0x20)
    assert wire.transfer([write(0x20, 0x12), read(0x20, 4)])[1] == bytes.fromhex("34123412")
    station.device.poke(0x0A, 0xA0)
    assert wire.transfer([write(0x20, 0x19), read(0x20, 3)])[1] == bytes.fromhex("121212")
    station.device.poke(0x05, 0x80)
    assert wire.transfer([write(0x20, 0x09), read(0x20, 1)])[1] == b"\x34"


def test_an_mcp23017_shows_pulled_up_inputs_inverted_ones_and_its_outputs() -> None:
    station = Station(CHIPS["mcp23017"].model, 0x20)
    station.device.levels = 0x00FF
    wire = Wire([station], 100_000)
    wire.transfer([write(0x20, 0x0C, 0x0F)])
    assert wire.transfer([write(0x20, 0x12), read(0x20, 1)])[1] == b"\x0f"  # the rest floats
    wire.transfer([write(0x20, 0x02, 0x03)])
    assert wire.transfer([write(0x20, 0x12), read(0x20, 1)])[1] == b"\x0c"
    wire.transfer([write(0x20, 0x00, 0x7F)])
    wire.transfer([write(0x20, 0x12, 0x80)])
    assert wire.transfer([write(0x20, 0x12), read(0x20, 1)])[1] == b"\x8c"
    assert wire.transfer([write(0x20, 0x14), read(0x20, 1)])[1] == b"\x80"


def test_a_pca9555_alternates_the_ports_of_a_pair() -> None:
    station = Station(CHIPS["pca9555"].model, 0x20)
    station.device.levels = 0x1234
    wire = Wire([station], 100_000)
    assert wire.transfer([write(0x20, 0x01), read(0x20, 3)])[1] == bytes.fromhex("123412")
    assert wire.transfer([write(0x20, 0x00), read(0x20, 2)])[1] == wire.transfer([read(0x20, 2)])[0]


def test_a_tca6424a_goes_round_its_three_ports_only_when_told_to() -> None:
    station = Station(CHIPS["tca6424a"].model, 0x22)
    station.device.levels = 0x563412
    wire = Wire([station], 100_000)
    assert wire.transfer([write(0x22, 0x81), read(0x22, 4)])[1] == bytes.fromhex("34561234")
    assert wire.transfer([write(0x22, 0x01), read(0x22, 2)])[1] == bytes.fromhex("3434")


def test_the_latches_of_a_pcf8575_take_turns_from_every_start_on() -> None:
    station = Station(CHIPS["pcf8575"].model, 0x20)
    station.device.levels = 0x3412
    wire = Wire([station], 100_000)
    wire.transfer([write(0x20, 0xF0, 0xFF)])
    assert wire.transfer([read(0x20, 3), read(0x20, 1)]) == [bytes.fromhex("103410"), b"\x10"]


def test_a_channel_is_connected_by_the_stop_and_not_before() -> None:
    wire = Wire([mcp(0x1234, mux=0x70, channel=2)], 100_000)
    with pytest.raises(NakError):
        wire.transfer([write(0x70, 0x04), write(0x20, 0x12), read(0x20, 2)])
    assert wire.transfer([write(0x20, 0x12), read(0x20, 2)])[1] == bytes.fromhex("3412")


def test_chips_of_one_address_on_two_connected_channels_answer_both() -> None:
    wire = Wire([mcp(0x1234, mux=0x70, channel=2), mcp(0x3214, mux=0x70, channel=3)], 100_000)
    wire.transfer([write(0x70, 0x0C)])
    assert wire.transfer([write(0x20, 0x12), read(0x20, 2)])[1] == (0x1234 & 0x3214).to_bytes(2, "little")


@given(
    st.lists(
        st.one_of(
            st.builds(lambda data: Message(0x20, data), st.binary(max_size=8)),
            st.builds(lambda length: Message(0x20, None, length), st.integers(1, 8)),
        ),
        min_size=1,
        max_size=6,
    )
)
def test_bytes_and_scl_periods_are_counted_as_data_sheets_draw_them(messages: list[Message]) -> None:
    wire = Wire([Station(CHIPS["pca9555"].model, 0x20)], 400_000)
    wire.transfer(messages)
    payload = sum(message.length if message.data is None else len(message.data) for message in messages)
    assert sum(wire.traffic.values()) == len(messages) + payload
    assert wire.scl_periods == 9 * (len(messages) + payload) + len(messages) + 1


def test_nobody_at_an_address_costs_the_address() -> None:
    wire = Wire([], 100_000)
    with pytest.raises(NakError):
        wire.transfer([write(0x20, 1, 2, 3), read(0x20, 2)])
    assert wire.scl_periods == 9 + 1 + 1
    assert wire.traffic == {(0x20, None, None, None): 1}


PAIR = [write(0x20, 0x12), read(0x20, 1)]
OTHER = [write(0x21, 0x12), read(0x21, 1)]


@pytest.mark.parametrize(
    ("kind", "messages", "code"),
    [
        ("bcm2835", PAIR * 2, errno.EOPNOTSUPP),
        ("bcm2835", PAIR, None),
        ("designware", PAIR + OTHER, errno.EINVAL),
        ("designware", PAIR * 2, None),
        ("i2c-gpio", PAIR + OTHER, None),
        ("any", PAIR * 21, None),
        ("any", [*PAIR * 21, write(0x20)], errno.EINVAL),
    ],
)
def test_an_adapter_lets_through_what_its_driver_does(kind: str, messages: list[Message], code: int | None) -> None:
    adapter = Adapter(
        Wire([Station(CHIPS["mcp23017"].model, 0x20), Station(CHIPS["mcp23017"].model, 0x21)], 100_000), kind
    )
    if code is None:
        assert len(adapter.rdwr(messages)) == len(messages)
        return
    with pytest.raises(OSError) as refused:
        adapter.rdwr(messages)
    assert refused.value.errno == code
    assert not adapter.wire.transfers


@pytest.mark.parametrize("kind", ADAPTERS)
def test_each_adapter_has_its_own_errno_for_a_nak(kind: str) -> None:
    adapter = Adapter(Wire([], 100_000), kind)
    with pytest.raises(OSError) as refused:
        adapter.rdwr([read(0x20, 1)])
    assert refused.value.errno == (errno.ENXIO if kind == "i2c-gpio" else errno.EREMOTEIO)


def test_a_fault_lasts_as_many_transfers_as_it_is_told() -> None:
    adapter = Adapter(Wire([mcp()], 100_000), "any")
    adapter.fail(errno.EIO, address=0x20, times=2)
    for _ in range(2):
        with pytest.raises(OSError):
            adapter.rdwr(PAIR)
    assert adapter.rdwr(PAIR)[1] == b"\xff"


@pytest.mark.parametrize("kind", CHIPS)
def test_a_chip_put_in_place_of_another_keeps_the_wires(kind: str) -> None:
    station = Station(CHIPS["tca6424a"].model, 0x22)
    station.device.levels = 0x123456
    station.become(CHIPS[kind].model)
    assert station.device.levels == 0x123456 & (1 << station.device.pins) - 1
