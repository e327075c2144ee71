import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from thenar.drivers import cyberglove_frame, scanner_frame
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.scanner_messages import (
    PROTOCOL,
    Event,
    FromBoard,
    GetState,
    Heartbeat,
    Hello,
    Ping,
    State,
    ToBoard,
    frame,
)

RUNS = 20_000
# The first byte of an input chooses to which command an answer is sought in it.
ANSWERS = b"?G\3\0?S\x12\0?T\x04\x80\0\1\0?iCyberGlove\r\n\0e?\0"


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    """What devices say when all is well, for mutation to start from."""
    record = cyberglove_frame.Record(bytes(range(60, 78)))
    hello = Hello(PROTOCOL, 0, 1, 1, 1, 0, 0, 1, 40, 1000, 0, 50_000, 0, 0, 0)
    messages: list[FromBoard | ToBoard] = [hello, State(5, 40), Heartbeat(7, 5, 40), Event(9, 3, 1)]
    messages += [Ping(1), GetState()]
    frames = [frame(message, number) for number, message in enumerate(messages)]
    said = {
        "records": cyberglove_frame.encode(record) * 3,
        **{f"answer {place}": bytes([place]) + ANSWERS for place in range(0, 40, 3)},
        "frames": b"".join(map(scanner_frame.encode, frames)),
        **{f"message {one.kind}": bytes((one.kind, one.sequence)) + one.payload for one in frames},
        "calibration": GloveCalibration(sensors=(SensorCalibration("index_mpj", 96, 0.0, 161, 90.0),))
        .to_toml()
        .encode(),
    }
    (tmp_path / "corpus").mkdir()
    for name, data in said.items():
        (tmp_path / "corpus" / name).write_bytes(data)
    return tmp_path / "corpus"


@pytest.mark.slow
def test_fuzzing_finds_no_crash(corpus: Path, tmp_path: Path) -> None:
    if importlib.util.find_spec("atheris") is None:
        (pytest.fail if os.environ.get("THENAR_REQUIRE_ALL") == "1" else pytest.skip)("atheris is missing")
    harness = Path(__file__).with_name("fuzz_drivers.py")
    limits = [f"-runs={RUNS}", "-seed=1", "-max_len=1024", "-rss_limit_mb=1024", f"-artifact_prefix={tmp_path}/"]
    command = [sys.executable, str(harness), *limits, str(corpus)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    assert f"Done {RUNS} runs" in done.stderr
