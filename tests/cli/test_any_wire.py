"""`thenar doctor --line` finds by itself how a glove writes its rows, and proposes what reads them."""

import json
import math
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import reduce
from operator import xor
from pathlib import Path
from struct import pack

import pytest

from thenar.drivers.emulated.ble import EmulatedPeripheral
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.live import checkup, stream_probe

from ..drivers import bumble_backend
from .conftest import thenar
from .test_streams import sending

FINGERS = ("thumb", "index", "middle", "ring", "little")


def bent(number: int) -> list[int]:
    """Return the readings of five fingers, of which the last does not move."""
    return [*(round(2000 + 1500 * math.sin(number / (9 + 2 * place) + place)) for place in range(4)), 777]


def joined(number: int, sign: str = ",", form: str = "{}") -> str:
    return sign.join(map(form.format, bent(number)))


def opengloves(number: int) -> str:
    return "".join(f"{letter}{count}" for letter, count in zip("ABCDE", bent(number), strict=True)) + "H" * (
        number // 20 % 2
    )


def nmea(number: int) -> str:
    body = f"GLV,{joined(number)}"
    return f"${body}*{reduce(xor, body.encode()):02X}\r"


def nested(number: int) -> str:
    return json.dumps({"flex": dict(zip(FINGERS, bent(number), strict=True)), "grip": number // 20 % 2 == 1})


def dated(number: int) -> str:
    return f"{(datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=number / 100)).isoformat()},{joined(number)}"


FLEX, PLAIN = [f"flex_{finger}" for finger in FINGERS], ["c1", "c2", "c3", "c4", "c5"]
# How a row is written; its columns that move, then the one that does not.
ENCODINGS: dict[str, tuple[Callable[[int], str | bytes], list[str]]] = {
    "alpha": (opengloves, FLEX),
    "legacy": (lambda number: f"{joined(number, '&')}&2047&2047&{number // 20 % 2}&0&0&0&0&0", FLEX),
    "checksum": (nmea, PLAIN),
    "brackets": (lambda number: f"<{joined(number)}>", PLAIN),
    "word": (lambda number: f"DATA: {joined(number, ' ')}", PLAIN),
    "nested": (nested, [f"flex.{finger}" for finger in FINGERS]),
    "hexadecimal": (lambda number: joined(number, " ", "0x{:03X}"), PLAIN),
    "units": (lambda number: joined(number, ", ", "{}deg"), PLAIN),
    "times": (dated, ["c2", "c3", "c4", "c5", "c6"]),
    "carriage return": (lambda number: joined(number).encode() + b"\r", PLAIN),
    "frames": (lambda number: pack("<2B5H", 0xAA, 0x55, *bent(number)), PLAIN),
}


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_doctor_finds_how_rows_are_written_and_its_proposal_reads_them(
    encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream_probe, "_PATIENCE_US", 1_500_000)
    monkeypatch.setattr(checkup, "_LISTEN_S", 0.3)
    write, (*moving, still) = ENCODINGS[encoding]

    def send(number: int) -> None:
        row = write(number)
        line.send(row if isinstance(row, bytes) else row.encode() + b"\n")

    path = tmp_path / "glove.toml"
    with PtyLine(tmp_path / "port") as line, sending(send):
        done = thenar("doctor", "--line", line.link, "--seconds", "1.5", "--propose", path, "--json")
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        stream = load_harness(path).streams[0]
        assert list(stream.taxels if stream.taxels else stream.joints) == moving
        assert any(still in remark and "did not move" in remark for remark in found["remarks"])
        assert (stream.time, stream.time_unit) == (("c1", "s") if encoding == "times" else (None, "ms"))
        assert stream.frame == ("AA 55 H5" if encoding == "frames" else None)
        (rows,) = [one for one in json.loads(thenar("doctor", path, "--json").stdout) if not one["part"]]
        assert rows["present"]
        assert 8_000 < rows["measured_us"] < 40_000


def test_doctor_finds_a_glove_by_bluetooth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "glove.toml"
    with EmulatedPeripheral("lucid") as glove:
        bumble_backend.use(monkeypatch, glove.hci)
        with sending(lambda number: glove.send(opengloves(number).encode() + b"\n")):
            done = thenar("doctor", "--line", "ble://lucid", "--seconds", "1", "--propose", path)
            assert done.returncode == 0, done.stderr
            (stream,) = load_harness(path).streams
            assert (stream.port, list(stream.joints), stream.switches) == (
                "ble://lucid",
                FLEX[:4],
                ("button_joystick",),
            )
            assert json.loads(thenar("doctor", path, "--json").stdout)[0]["present"]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ('frame = "F0 X5"', "'X5' is neither a byte nor a type of numbers: write fixed bytes in hexadecimal"),
        ('frame = "B5"', "'B5' needs a fixed byte and a number"),
        ('frame = "F0 B5"', "1 columns are named, but a frame has 5 numbers: name every one in order"),
    ],
)
def test_a_pattern_that_cannot_be_is_said_with_its_line(keys: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "glove.toml"
    path.write_text(f'[[stream]]\nport = "ble://x"\ncolumns = ["s"]\nswitches = ["s"]\n{keys}\n')
    done = thenar("doctor", path)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())
    assert "glove.toml" in done.stderr
