"""A harness with everything in it, as text and on disk."""

from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.runtime.harness.loading import load_harness
from thenar.runtime.harness.wiring import Harness

FULL = """\
name = "bench"

[cyberglove]
port = "/dev/ttyUSB0"
baud = 38_400
rate_hz = 100
sensors = 18
calibration = "anna.toml"

[[stream]]
port = "/dev/ttyACM0"
switches = ["s100", "s102"]
taxels = { s103 = [0, 1023], s104 = [0, 1023] }

[stream.board]
pins = { s103 = "A0", s104 = "A1.3" }
select = ["4", "5", "6", "7"]
matrix = { rows = ["8", "9"], columns = ["10"], keys = [["s100"], [""]], diodes = true }

[[stream.board.chip]]
kind = "mcp23017"
address = 0x21
pins = { GPA0 = "s102" }

[[bus]]
device = "/dev/i2c-1"
clock_hz = 400_000

[[bus.chip]]
kind = "mcp23017"
address = 0x20
pins = { GPA0 = "s001", GPB3 = "s014" }

[[bus.chip]]
kind = "tca6424a"
address = 0x22
mux = { address = 0x70, channel = 2 }
closed = "high"
pins = { P07 = "s020", P20 = "s021" }

[[bus.chip]]
kind = "tca6424a"
address = 0x22
mux = { address = 0x70, channel = 3 }
pins = { P07 = "s030" }

[debounce]
press_lockout_ms = 4
"""


@pytest.fixture(scope="session")
def full_text() -> str:
    return FULL


@pytest.fixture
def load(tmp_path: Path) -> Callable[[str], Harness]:
    def write_and_load(text: str) -> Harness:
        path = tmp_path / "glove.toml"
        path.write_text(text)
        return load_harness(path)

    return write_and_load
