"""Recordings made to fill the memory: whoever reads one of n bytes takes at most 200 MB + 20 n, and 10 n calls.

Calls of functions are counted: no other load of the computer changes them.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from struct import pack

import msgspec
import pytest
from msgspec.structs import replace

from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.layout import (
    RECOGNITION,
    SWITCHES,
    TRIALS,
    beginning,
    encode_bytes,
    encode_text,
)
from thenar.runtime.recording.mcap import LARGEST_RECORD
from thenar.runtime.recording.session import Collection, CollectionTask, Label, Session, to_metadata

READ = """
import re, sys
from pathlib import Path
from thenar.compiler.recordings.mcap_recording import import_recordings
from thenar.drivers.errors import ThenarError
from thenar.runtime.recording.guide import planned, read_journal
from thenar.simulator.playing.performance import of_recording
path, calls = Path(sys.argv[1]), 0
def count(_frame, event, _what):
    global calls
    calls += event in {"call", "c_call"}
sys.setprofile(count)
for read in (lambda: import_recordings([path]), lambda: planned(read_journal(path).session.collection),
             lambda: of_recording(path, 1)):
    try:
        read()
    except ThenarError as reason:
        print(str(reason)[:200])
sys.setprofile(None)
print(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1])
print(calls)
"""

COLLECTION = Collection(
    "A", "own", ("cup", "pen"), (CollectionTask("cup", ("mug",)), CollectionTask("pen", ("biro",))), 1, 0
)
SESSION = Session(thenar="1", switches=("s1", "s2"), sensors=(), collection=COLLECTION)
GRASP = LiveGrasp(1, 1, 0, "cup", "cup", 1.0, 1, "ok", 1, 1, 1)
LABEL = Label(1, "captured", 1, "cup", "A", "mug")
JSON = msgspec.json.encode


def record(opcode: int, content: bytes) -> bytes:
    return pack("<BQ", opcode, len(content)) + content


def described(session: Session, **texts: str) -> bytes:
    """Return the session's record, with JSON `texts` in place of its own fields."""
    metadata = to_metadata(session)
    fields = {name: JSON(value).decode() for name, value in msgspec.json.decode(metadata["session"]).items()} | texts
    metadata["session"] = "{" + ",".join(f'"{name}":{text}' for name, text in fields.items()) + "}"
    pairs = b"".join(
        pack("<I", len(part)) + part for pair in metadata.items() for part in (text.encode() for text in pair)
    )
    return record(12, pack("<I", 6) + b"thenar" + pack("<I", len(pairs)) + pairs)


def message(channel: int, data: bytes) -> bytes:
    return record(5, pack("<HIQQ", channel, 0, 1, 1) + data)


def label(**changed: object) -> bytes:
    return message(TRIALS, encode_text(JSON(replace(LABEL, **changed))))


def long_list_in_a_message() -> Iterator[bytes]:
    yield described(SESSION)
    text = JSON(GRASP).replace(b'"lost":[]', b'"lost":["ab"' + b',"ab"' * (LARGEST_RECORD // 5 - 100) + b"]")
    yield message(RECOGNITION, encode_text(text))


def message_beyond_the_longest() -> Iterator[bytes]:
    yield described(SESSION)
    text = JSON(GRASP).replace(b'"lost":[]', b'"lost":["ab"' + b',"ab"' * (2 * LARGEST_RECORD // 5) + b"]")
    yield message(RECOGNITION, encode_text(text))


def long_list_in_a_session() -> Iterator[bytes]:
    yield described(SESSION, switches='["ab"' + ',"ab"' * (LARGEST_RECORD // 5 - 1000) + "]")


def tasks_without_end() -> Iterator[bytes]:
    task = '{"grasp":"a","objects":["b"]}'
    collection = JSON(COLLECTION).decode().partition('"tasks":')[0]
    tasks = ",".join([task] * (LARGEST_RECORD // 31))
    yield described(SESSION, collection=f'{collection}"tasks":[{tasks}],"repetitions":1000000,"seed":1}}')


def trials_of_one_wide_frame() -> Iterator[bytes]:
    names = tuple(f"{number:x}" for number in range(60_000))
    yield described(replace(SESSION, switches=names))
    yield message(SWITCHES, encode_bytes(bytes(60_000)))
    yield (label() + label(event="accepted")) * 20_000


def trials_beside_one_long_name() -> Iterator[bytes]:
    yield described(SESSION)
    yield message(SWITCHES, encode_bytes(bytes(2)))
    yield label(object="x" * 1_000_000) + label(event="accepted")
    yield (label() + label(event="accepted")) * 10_000


def sessions_without_end() -> Iterator[bytes]:
    for _ in range(3000):
        yield described(SESSION)
        yield message(SWITCHES, encode_bytes(bytes(2))) + label() + label(event="accepted")


@pytest.mark.slow
@pytest.mark.parametrize(
    "bomb",
    [
        long_list_in_a_message,
        message_beyond_the_longest,
        long_list_in_a_session,
        tasks_without_end,
        trials_of_one_wide_frame,
        trials_beside_one_long_name,
        sessions_without_end,
    ],
)
def test_a_recording_made_to_fill_the_memory_does_not(bomb: Callable[[], Iterator[bytes]], tmp_path: Path) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(beginning("1") + b"".join(bomb()))
    done = subprocess.run([sys.executable, "-c", READ, path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    *said, peak_kb, calls = done.stdout.splitlines()
    assert said or bomb is sessions_without_end
    assert 1024 * int(peak_kb) <= 200e6 + 20 * path.stat().st_size
    print(f"{int(calls) / path.stat().st_size:.3f} calls a byte")
    assert int(calls) <= 10 * path.stat().st_size
