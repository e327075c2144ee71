"""`thenar doctor --line` finds by itself how a glove writes its rows, and proposes what reads them."""

import json
import math
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from struct import pack

import pytest

from thenar.drivers.emulated.ble import EmulatedPeripheral
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.live import checkup, stream_probe

from ..drivers import bumble_backend
from ..drivers.test_encodings import FLEXION, nmea
from ..sending import sending
from .conftest import thenar, works

START = datetime(2026, 1, 1, tzinfo=UTC)
NESTED, PLAIN = [f"flex.{number}" for number in range(5)], ["c1", "c2", "c3", "c4", "c5"]


def bent(number: int) -> list[int]:
    """Return the readings of five fingers, of which the last does not move."""
    return [*(round(2000 + 1500 * math.sin(number / (9 + 2 * place) + place)) for place in range(4)), 777]


def row(number: int, sign: str = ",", form: str = "{}") -> str:
    return sign.join(map(form.format, bent(number)))


def alpha(number: int) -> str:
    pressed = "H" * (number // 20 % 2)
    return "".join(f"{letter}{count}" for letter, count in zip("ABCDE", bent(number), strict=True)) + f"{pressed}\n"


# How a row is written, and its columns, of which the last does not move.
ENCODINGS: dict[str, tuple[Callable[[int], str], list[str]]] = {
    "alpha by Bluetooth": (alpha, FLEXION),
    "legacy": (lambda number: f"{row(number, '&')}&2047&2047&{number // 20 % 2}&0&0&0&0&0\n", FLEXION),
    "checksum": (lambda number: f"{nmea(f'GLV,{row(number)}')}\r\n", PLAIN),
    "brackets": (lambda number: f"<{row(number)}>\r", PLAIN),
    "word": (lambda number: f"DATA: {row(number, ' ')}\n", PLAIN),
    "nested": (lambda number: json.dumps({"flex": bent(number), "grip": number % 40 < 20}) + "\n", NESTED),
    "hexadecimal": (lambda number: f"{row(number, ' ', '0x{:03X}')}\n", PLAIN),
    "units": (lambda number: f"{row(number, ', ', '{}deg')}\n", PLAIN),
    "times": (lambda number: f"{(START + timedelta(seconds=number / 100)).isoformat()},{row(number)}\n", [*"23456"]),
    "frames": (lambda number: pack("<2B5H", 0xAA, 0x55, *bent(number)).decode("latin-1"), PLAIN),
}


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_doctor_finds_how_rows_are_written_and_its_proposal_reads_them(
    encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream_probe, "_PATIENCE_US", 1_500_000)
    monkeypatch.setattr(checkup, "_LISTEN_S", 0.3)
    path, (write, (*moving, still)) = tmp_path / "glove.toml", ENCODINGS[encoding]
    with PtyLine(tmp_path / "port") as line, EmulatedPeripheral("lucid") as peripheral:
        bumble_backend.use(monkeypatch, peripheral.hci)
        send, port = (peripheral.send, "ble://lucid") if "Bluetooth" in encoding else (line.send, line.link)
        with sending(lambda number: send(write(number).encode("latin-1"))):
            done = works("doctor", "--line", port, "--seconds", "1.5", "--propose", path, "--json")
            (rows,) = [one for one in json.loads(thenar("doctor", path, "--json").stdout) if not one["part"]]
    stream, timed = load_harness(path).streams[0], encoding == "times"
    assert list(stream.taxels or stream.joints) == [f"c{name}" if timed else name for name in moving]
    assert any(still in remark and "did not move" in remark for remark in json.loads(done.stdout)["remarks"])
    assert (stream.port, stream.time, stream.time_unit) == (str(port), *(("c1", "s") if timed else (None, "ms")))
    assert stream.frame == ("AA 55 H5" if encoding == "frames" else None)
    assert rows["present"]
    assert 8_000 < rows["measured_us"] < 40_000
