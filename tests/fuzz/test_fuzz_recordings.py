"""Recordings that are wrong inside and sound outside, through everything that reads recordings: rows, a sentence, or
an error of ours, and nothing else.

A mutant begins as a good recording, cut into its records. One to three of them are changed, each in a way that its kind
invites: a key of its JSON takes another value, a text another length, a record is doubled, moved, packed into a chunk.
Then the file is put together again with the right lengths and checksums, so that every change reaches what is behind
them.
"""

import json
import random
import resource
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from struct import pack, unpack_from
from typing import Any, Literal
from zlib import crc32

import numpy as np
import pytest
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.records import Metadata

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.mcap_recording import import_recordings
from thenar.compiler.recordings.taxonomy import own
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.build import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, GloveWiring, Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.live.replay import replayed
from thenar.runtime.live.system import System
from thenar.runtime.policy import Policy
from thenar.runtime.recording.guide import planned, read_journal
from thenar.runtime.recording.layout import MAGIC
from thenar.runtime.recording.session import Collection, Label, Session, Task
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.sinks.jsonl import encode
from thenar.simulator.playing.performance import of_recording

TYPES = ("cup", "pen", "rod")
SENSORS = tuple(f"j{number}" for number in range(18))
FRAMES = 12


MESSAGE, CHUNK, METADATA, DATA_END = 5, 6, 12, 15
HEAD = 22
Record = tuple[int, bytes]

NUMBERS = (0, -1, 1, 255, 2**31, 2**53, 2**63 - 1, 2**63, -(2**63) - 1, 2**64, 10**400, 1e308, -0.0, 0.5, 1e-320)
TEXTS = ("", " ", "a", "\0", "\x1b[31m", "\u202e", "?", "=1+1", "x" * 5000, "\U0010ffff", "ä", "unknown", "thenar")
VALUES: tuple[Any, ...] = (None, True, [], {}, [[]], ["a"] * 300, {"a": 1}, *NUMBERS, *TEXTS)
RAW = ("[" * 3000, "{" * 3000, "nul", '"\\ud800"', "9" * 5000, "1e999", "NaN", "[1,2", '{"a":1,"a":2}', "\xff")


def records_of(data: bytes) -> list[Record]:
    """Return the records of a recording's data section."""
    found, place = [], len(MAGIC)
    while data[place] != DATA_END:
        opcode, length = unpack_from("<BQ", data, place)
        place += 9 + length
        found.append((opcode, data[place - length : place]))
    return found


def sealed(records: list[Record]) -> bytes:
    """Return the file of these records, closed, without a summary."""
    data = MAGIC + b"".join(pack("<BQ", opcode, len(content)) + content for opcode, content in records)
    footer = pack("<BQQQ", 2, 20, 0, 0)
    return data + pack("<BQI", DATA_END, 4, crc32(data)) + footer + pack("<I", crc32(footer)) + MAGIC


def mutant(records: list[Record], draw: random.Random) -> bytes:
    """Return a mutant of the recording that holds these records."""
    changed = list(records)
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        kind = draw.choices((MESSAGE, METADATA, None), (5, 4, 1))[0]
        place = draw.choice([n for n, (opcode, _) in enumerate(changed) if opcode == kind] or range(len(changed)))
        changed[place : place + 1] = draw.choice(_WAYS)(changed[place], draw)
        if not changed:
            break
    return sealed(changed)


def _bytes_changed(record: Record, draw: random.Random) -> list[Record]:
    content = bytearray(record[1])
    for _ in range(draw.randint(1, 3)):
        place = draw.randrange(len(content) + 1)
        content[place : place + draw.randint(0, 4)] = draw.randbytes(draw.randint(0, 4))
    return [(record[0], bytes(content))]


def _moved(record: Record, draw: random.Random) -> list[Record]:
    opcode, content = record
    return draw.choice(([], [record] * 2, [(draw.choice((1, *range(3, 15), 99)), content)], [(opcode, content * 2)]))


def _packed(record: Record, draw: random.Random) -> list[Record]:
    opcode, content = record
    inner = (pack("<BQ", opcode, len(content)) + content) * draw.choice((1, 1, 3, 200))
    size, crc = draw.choice((len(inner), len(inner), 0, 2**63)), draw.choice((0, crc32(inner), 1))
    compression = draw.choice((b"", b"", b"lz4", b"zstd", b"\x1b[2J" * 50))
    head = pack("<QQQII", 0, 0, size, crc, len(compression)) + compression
    return [(CHUNK, head + pack("<Q", draw.choice((len(inner), len(inner), 7, 2**62))) + inner)]


def _said_otherwise(record: Record, draw: random.Random) -> list[Record]:
    """Change what a record says, by its kind."""
    opcode, content = record
    if opcode == METADATA:
        return [(METADATA, _metadata(content, draw))]
    if opcode != MESSAGE or len(content) < HEAD:
        return _bytes_changed(record, draw)
    head, data = bytearray(content[:HEAD]), content[HEAD:]
    if draw.random() < 0.15:
        kind, place = draw.choice((("<H", 0), ("<Q", 6), ("<Q", 14)))
        number = draw.choice((0, 1, 2, 3, 4, 5, 6, 65535, 2**63, 2**64 - 1))
        head[place : place + (2 if kind == "<H" else 8)] = pack(kind, number & (0xFFFF if kind == "<H" else 2**64 - 1))
    elif data[8:9] == b"{":
        text = _json(data[8:-1].decode("utf-8", "replace"), draw).encode("utf-8", "surrogatepass")
        data = pack("<4sI", b"\0\1\0\0", len(text) + 1) + text + b"\0"
    else:
        length = draw.choice((len(data) - 16, len(data) - 16, 0, 40))
        states = bytes(draw.randrange(draw.choice((2, 8, 256))) for _ in range(length))
        data = pack("<4sIII", b"\0\1\0\0", 0, 0, len(states)) + states
    return [(MESSAGE, bytes(head) + data)]


def _metadata(content: bytes, draw: random.Random) -> bytes:
    try:
        found = Metadata.read(ReadDataStream(BytesIO(content)))
        key = draw.choice(list(found.metadata))
    except Exception:  # another change of this mutant made it unreadable
        return content
    texts = dict(found.metadata)
    texts[key] = draw.choice((*TEXTS, *RAW)) if draw.random() < 0.4 else _json(texts[key], draw)
    if draw.random() < 0.1:
        del texts[key]
    builder: Any = RecordBuilder()
    Metadata(found.name, {key: text.encode("utf-8", "replace").decode() for key, text in texts.items()}).write(builder)
    data: bytes = builder.end()
    return data[9:]


def _json(text: str, draw: random.Random) -> str:
    """Return JSON `text` with one value changed, somewhere in it."""
    if draw.random() < 0.1:
        return draw.choice(RAW)
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return str(draw.choice(VALUES))
    return json.dumps(_changed(value, draw))


def _changed(value: Any, draw: random.Random) -> Any:
    if isinstance(value, dict) and value and draw.random() < 0.95:
        key = draw.choice(list(value))
        return {**value, key: _changed(value[key], draw)}
    if isinstance(value, list) and value and draw.random() < 0.8:
        place = draw.randrange(len(value))
        how = draw.random()
        if how < 0.2:
            return value[:place] + value[place + 1 :]
        if how < 0.4:
            return value[:place] + value[place : place + 1] * draw.choice((2, 50)) + value[place:]
        return [*value[:place], _changed(value[place], draw), *value[place + 1 :]]
    return draw.choice(VALUES)


_WAYS: tuple[Callable[[Record, random.Random], list[Record]], ...] = (
    *[_said_otherwise] * 12,
    _bytes_changed,
    _moved,
    _packed,
)


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Build:
    draw = np.random.default_rng(4)
    labels = np.arange(30) % 3
    grasps = GraspSet(
        switches=np.array([[0, 0, 1, 1], [0, 1, 0, 1], [1, 0, 0, 1]], bool)[labels] ^ (draw.random((30, 4)) < 0.1),
        switch_names=tuple(f"s{number}" for number in range(4)),
        codes=(60 * labels[:, None] + draw.integers(1, 60, (30, 2))).astype(np.uint16),
        joints=tuple(Joint(name, "deg", 0, 0.0, 255, 127.5) for name in SENSORS[:2]),
        grasps=np.array(TYPES)[labels],
        taxonomy=own(TYPES),
        subjects=np.full(30, "A"),
        objects=np.full(30, "thing"),
        trials=np.arange(30),
    )
    return Build.load(compile_build(grasps, tmp_path_factory.mktemp("fuzz") / "build", rounds=10, folds=0).folder)


@pytest.fixture(scope="module")
def records(build: Build, tmp_path_factory: pytest.TempPathFactory) -> list[Record]:
    """Return those of a recording that is a run of `build` and a collection at once, and was resumed."""
    names = tuple(switch.name for switch in build.manifest.switches)
    chip = ChipWiring("mcp23017", 0x20, pins={f"GPA{number}": name for number, name in enumerate(names)})
    buses = (BusWiring("/dev/zero", chips=(chip,)),)
    harness = Harness("fuzzed", GloveWiring("/dev/null", joints=SENSORS), buses=buses)
    calibration = GloveCalibration(sensors=tuple(SensorCalibration(name, 1, 0.0, 255, 127.0) for name in SENSORS))
    system = System(build, harness, System.map_of(build, harness), SENSORS, calibration, Policy())
    session = Session(
        thenar="0.0.1",
        switches=names,
        sensors=SENSORS,
        build=build.manifest.checksum,
        harness=harness_to_toml(harness),
        calibration=calibration,
        policy=system.policy,
        collection=Collection("A", "own", TYPES, tuple(Task(name, ("mug", "jar")) for name in TYPES), 2, 7),
    )
    path = tmp_path_factory.mktemp("fuzz") / "whole.mcap"
    recognizer = system.recognizer()
    for begun in range(2):
        tail = read_journal(path).tail if begun else None
        with Recorder(path, session, tail=tail) as recorder:
            for number in range(FRAMES):
                time_us = 10_000 * (FRAMES * begun + number)
                glove = GloveFrame(time_us, bytes((10 + 10 * number, *[200] * 17)))
                switches = SwitchFrame(time_us, number % (1 << len(names)), lost=int(number == 5))
                recorder.glove(glove)
                recorder.switches(switches)
                recorder.grasp(recognizer.step(time_us + 10, 10**15 + time_us, switches, glove).grasp)
                event: Literal["captured", "accepted"] = "captured" if number % 2 == 0 else "accepted"
                trial = 1 + begun * FRAMES // 2 + number // 2
                recorder.label(Label(time_us + 20, event, trial, TYPES[trial % 3], "A", "mug"))
    return records_of(path.read_bytes())


def read_in_every_way(build: Build, path: Path) -> Iterator[int]:
    """Yield how much each reader made of the file; an error of ours is nothing."""
    for reader in (imported, resumed, run_again, played):
        try:
            yield reader(build, path)
        except (ThenarError, OSError) as reason:
            said = str(reason)
            assert said
            assert len(said) < 2000, said
            assert said.isprintable(), said
            yield 0


def imported(_build: Build, path: Path) -> int:
    return len(import_recordings([path])[0])


def resumed(_build: Build, path: Path) -> int:
    collection = read_journal(path).session.collection
    assert collection is not None
    return len(planned(collection))


def run_again(build: Build, path: Path) -> int:
    return sum(len(encode(now, None, None)) for _, now in replayed(build, path))


def played(_build: Build, path: Path) -> int:
    return len(of_recording(path, 10_000))


@pytest.mark.parametrize(
    "seeds",
    [pytest.param(range(400), id="a few"), pytest.param(range(400, 20_400), marks=pytest.mark.slow, id="20,000")],
)
def test_no_mutant_raises_anything_but_our_errors(
    build: Build, records: list[Record], tmp_path: Path, seeds: range
) -> None:
    path = tmp_path / "mutant.mcap"
    made = [0, 0, 0, 0]
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for seed in seeds:
        path.write_bytes(mutant(records, random.Random(seed)))
        made = [one + more for one, more in zip(made, read_in_every_way(build, path), strict=True)]
    # Most mutants are read by most readers: the fuzz goes deep.
    assert all(many > len(seeds) for many in made), made
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 200_000


def test_a_replay_and_an_emulation_tell_of_damage(build: Build, records: list[Record], tmp_path: Path) -> None:
    path, said = tmp_path / "damaged.mcap", list[str]()
    path.write_bytes(sealed(records))
    list(replayed(build, path, warn=said.append))
    assert said == []
    data = bytearray(path.read_bytes())
    place = data.rindex(b'{"time_us"')
    data[place + len('{"time_us":')] ^= 1
    path.write_bytes(data)
    list(replayed(build, path, warn=said.append))
    of_recording(path, 10_000, warn=said.append)
    assert said == ["damaged.mcap is altered: the checksum of its data does not match"] * 2


def test_a_replay_of_other_switches_than_the_builds_is_refused(
    build: Build, records: list[Record], tmp_path: Path
) -> None:
    path = tmp_path / "others.mcap"
    kept = ",".join(f'"{switch.name}"' for switch in build.manifest.switches).encode()
    others = kept.replace(b"s", b"t")
    renamed = [(opcode, content.replace(b"[" + kept + b"]", b"[" + others + b"]")) for opcode, content in records]
    path.write_bytes(sealed(renamed))
    with pytest.raises(SettingError, match="names other switches than its build has"):
        list(replayed(build, path))
