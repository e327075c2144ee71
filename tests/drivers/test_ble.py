"""Rows by Bluetooth Low Energy, from an emulated peripheral: real packets of HCI, ATT and GATT, on both sides."""

import contextlib
import sys
from collections.abc import Iterator
from queue import Empty, Queue
from time import monotonic

import pytest

from thenar.drivers import ble
from thenar.drivers.emulated.ble import ADDRESS, EmulatedPeripheral
from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.lines import Row
from thenar.drivers.readers import LineReader
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.live.sources import DeviceThread
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources.base import sources_of

from . import bumble_backend
from .test_transports import LONG_S, heard

OWN = ["0000ffe1-0000-1000-8000-00805f9b34fb", "2b9c1e40-54a1-4c5f-a7a1-0d3f1f3f0a11"]


@pytest.fixture
def glove(monkeypatch: pytest.MonkeyPatch) -> Iterator[EmulatedPeripheral]:
    with EmulatedPeripheral("My Glove") as peripheral:
        bumble_backend.use(monkeypatch, peripheral.hci)
        yield peripheral


@pytest.mark.parametrize("name", ["my glove", ADDRESS.lower(), f"My Glove/{ble.NORDIC_UART.upper()}"])
def test_a_peripheral_is_found_by_name_and_by_address(glove: EmulatedPeripheral, name: str) -> None:
    with LineReader(f"ble://{name}") as reader:
        reader.open()
        glove.send(b"A2048B1990(AB)300H\n")
        assert heard(reader, 1)[0].values[:3] == (2048, 1990, 300)


def test_notifications_without_line_ends_are_lines_and_frames_need_none(glove: EmulatedPeripheral) -> None:
    with LineReader("ble://My Glove") as lines, LineReader("ble://My Glove", frame="F0 B2 F7") as frames:
        lines.open()
        for number in range(40):
            glove.send(b"%d,7" % number)
        assert heard(lines, 25) == [Row(None, (number, 7)) for number in range(15, 40)]
        lines.close()
        lines.open()
        glove.send(b"1,2")
        assert heard(lines, 1) == [Row(None, (1, 2))]
        lines.close()
        frames.open()
        glove.send(b"\xf0\x0a\x0d\xf7" * 3)
        assert heard(frames, 3) == [Row(None, (10, 13))] * 3


def test_which_of_several_characteristics_is_meant_has_to_be_said(monkeypatch: pytest.MonkeyPatch) -> None:
    with EmulatedPeripheral("two", OWN) as peripheral:
        bumble_backend.use(monkeypatch, peripheral.hci)
        for port in ("ble://two", "ble://two/1234"):
            with pytest.raises(SettingError, match=f"ble://two/{OWN[0]} or ble://two/{OWN[1]}"):
                LineReader(port).open()
        for way in (OWN[0], "ffe1"):
            with LineReader(f"ble://two/{way}") as reader:
                reader.open()
                peripheral.send(b"1,2\n")
                assert heard(reader, 1) == [Row(None, (1, 2))]


def test_what_is_missing_is_said(glove: EmulatedPeripheral, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ble, "_SEARCH_S", 0.3)
    with pytest.raises(DeviceError, match=r"ble://other: it does not advertise.*: others are My Glove$"):
        LineReader("ble://other").open()
    bumble_backend.use(monkeypatch, 1)
    with pytest.raises(DeviceError, match="is this computer's Bluetooth on"):
        LineReader("ble://My Glove").open()
    monkeypatch.setitem(sys.modules, "bleak", None)
    with pytest.raises(SettingError, match=r'ble://My Glove: bleak is not installed: pip install "thenar\[ble\]"'):
        LineReader("ble://My Glove").open()


def test_a_stream_by_bluetooth_is_read_again_when_it_returns(glove: EmulatedPeripheral) -> None:
    text = '[[stream]]\nport = "ble://My Glove"\njoints = { flex = [0, 254] }\ncolumns = ["flex"]\n'
    harness, frames = parse_harness(text, "glove.toml"), Queue[SwitchFrame | GloveFrame]()
    (source,) = sources_of(harness, (), whole_scan(harness, ()))
    keeper = DeviceThread("glove", source, frames.put)
    keeper.start()
    try:
        for number in (1, 2):
            end, code = monotonic() + LONG_S, b""
            while code != bytes([1 + number]):
                assert monotonic() < end
                glove.send(b"%d\n" % number)
                with contextlib.suppress(Empty):
                    frame = frames.get(timeout=0.02)
                    code = frame.sensors if isinstance(frame, GloveFrame) else b""
            glove.hang_up()
            while keeper.state.connected and keeper.opened == number:
                assert monotonic() < end
            assert keeper.opened > number or "ble://My Glove: the connection is lost" in keeper.state.error
        assert keeper.faults == 0
    finally:
        keeper.close()
