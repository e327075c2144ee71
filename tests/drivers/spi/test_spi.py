"""Converters on SPI: their bits, and a driver that meets them on a real device node."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.emulated.i2c import EmulatedI2c
from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.spi.chips import SPI_CHIPS
from thenar.drivers.spi.device import SpiDevice

from ...conftest import tool

DEVICES = ("/dev/spidev0.0", "/dev/spidev0.1", "/dev/spidev1.0")

# Answers, one list a line, for every line of stdin: [device, kind, channels].
CLIENT = """
import json, sys
from thenar.drivers.errors import DeviceError
from thenar.drivers.spi.chips import SPI_CHIPS
from thenar.drivers.spi.device import SpiDevice
open_devices = {}
for line in sys.stdin:
    device, kind, channels = json.loads(line)
    chip = SPI_CHIPS[kind]
    try:
        if device not in open_devices:
            made = SpiDevice(device, chip, chip.clock_hz)
            made.open()
            open_devices[device] = made
        answer = open_devices[device].prepare([chip.readings[channel] for channel in channels])()
    except DeviceError as error:
        answer = str(error)
    print(json.dumps(answer), flush=True)
"""


@pytest.mark.parametrize("kind", SPI_CHIPS)
@given(code=st.integers(0, 0xFFFF), channel=st.integers(0, 7))
def test_every_channel_is_read_and_no_other_shows(kind: str, code: int, channel: int) -> None:
    chip = SPI_CHIPS[kind]
    model = chip.model(len(chip.pins), chip.bits)
    model.levels = code << 16 * (channel % len(chip.pins))
    wanted = [min(code, chip.highest) if number == channel % len(chip.pins) else 0 for number in range(len(chip.pins))]
    assert [chip.code(model.transfer(each.command)) for each in chip.readings] == wanted


# Bytes of the data sheets' figures 6-1 (MCP3008) and 6-1 (MCP3208): what goes out for channel 5, single-ended.
@pytest.mark.parametrize(
    ("kind", "sent"), [("mcp3008", b"\x01\xd0\x00"), ("mcp3208", b"\x07\x40\x00"), ("mcp3204", b"\x06\xc0\x00")]
)
def test_what_goes_out_is_what_the_data_sheet_draws(kind: str, sent: bytes) -> None:
    chip = SPI_CHIPS[kind]
    reading = chip.readings[min(5, len(chip.pins) - 1)]
    assert reading.command == sent
    assert reading.scl_periods == 24


@pytest.mark.parametrize("kind", SPI_CHIPS)
def test_a_line_that_nobody_drives_low_is_no_code(kind: str) -> None:
    assert SPI_CHIPS[kind].code(b"\xff\xff\xff") is None


@given(sent=st.binary(max_size=6))
def test_any_bytes_are_answered_by_as_many(sent: bytes) -> None:
    for chip in SPI_CHIPS.values():
        model = chip.model(len(chip.pins), chip.bits)
        model.levels = (1 << 128) - 1
        assert len(model.transfer(sent)) == len(sent)


@pytest.mark.parametrize("kind", SPI_CHIPS)
def test_every_converters_package_has_its_pins_supply_and_bus(kind: str) -> None:
    pins = SPI_CHIPS[kind].package.pins
    wired = (*SPI_CHIPS[kind].pins, "CS", "DIN", "DOUT", "CLK", "AGND", "DGND", "VREF", "VDD")
    assert all(pins.count(name) == 1 for name in wired)
    assert len(pins) == (16 if len(SPI_CHIPS[kind].pins) == 8 else 14)


class Rig:
    def __init__(self, emulated: EmulatedI2c) -> None:
        self.emulated = emulated
        self._client = subprocess.Popen(
            [sys.executable, "-c", CLIENT],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **emulated.environment},
        )

    def read(self, device: str, kind: str, channels: Sequence[int]) -> list[int | None] | str:
        assert self._client.stdin is not None
        assert self._client.stdout is not None
        self._client.stdin.write(json.dumps([device, kind, channels]) + "\n")
        self._client.stdin.flush()
        answer: list[int | None] | str = json.loads(self._client.stdout.readline())
        return answer

    def close(self) -> None:
        self._client.communicate(timeout=10)


@pytest.fixture
def rig() -> Iterator[Rig]:
    """An MCP3208, an MCP3008, and a device node with nothing behind it."""
    tool("umockdev-wrapper")
    kinds = ("mcp3208", "mcp3008", None)
    with EmulatedI2c([], dict(zip(DEVICES, kinds, strict=True))) as emulated:
        made = Rig(emulated)
        yield made
        made.close()


def test_the_driver_reads_all_channels_in_one_call(rig: Rig) -> None:
    twelve, ten = [4095, 1, 2000, 0, 70, 71, 3000, 9], [1023, 0, 5, 600, 7, 8, 9, 1]
    rig.emulated.set_all(
        [[sum(code << 16 * channel for channel, code in enumerate(codes))] for codes in (twelve, ten, [0] * 8)]
    )
    assert rig.read(DEVICES[0], "mcp3208", list(range(8))) == twelve
    assert rig.read(DEVICES[1], "mcp3008", [3, 0, 3]) == [600, 1023, 600]
    seen = rig.emulated.counters(0)
    assert (seen.calls, seen.transfers, seen.scl_periods) == (1, 8, 8 * 24)


def test_where_nothing_answers_there_is_no_code(rig: Rig) -> None:
    assert rig.read(DEVICES[2], "mcp3208", [0, 7]) == [None, None]


def test_a_device_that_goes_is_told_and_opened_again(rig: Rig) -> None:
    assert rig.read(DEVICES[0], "mcp3208", [1]) == [0]
    rig.emulated.unplug(0)
    assert "does not work: there is no such device" in str(rig.read(DEVICES[0], "mcp3208", [1]))


def test_wrong_and_missing_device_paths_are_refused() -> None:
    chip = SPI_CHIPS["mcp3208"]
    with pytest.raises(SettingError, match="is not the path of a device"):
        SpiDevice("socket://x:1", chip, 1)
    device = SpiDevice("/dev/spidev99.9", chip, 1_000_000)
    with pytest.raises(DeviceError, match="is SPI switched on"):
        device.open()
    with pytest.raises(DeviceError, match="is not open"):
        device.prepare(chip.readings)()
