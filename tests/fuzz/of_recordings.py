"""Recordings of live gloves, as `thenar import`, `thenar record` and `thenar run --replay` read them."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from struct import Struct

import msgspec
from material import GLOVE_TOML, GRASPS, SWITCHES, Format, harness, loaded_build
from mutating_mcap import mcap_file

from thenar.compiler.recordings.mcap_recording import import_recordings
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.drivers.errors import ThenarError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.replay import replayed
from thenar.runtime.live.system import LiveSystem
from thenar.runtime.recording import layout
from thenar.runtime.recording.guide import planned, read_journal
from thenar.runtime.recording.layout import (
    Tail,
    beginning,
    encode_bytes,
    encode_text,
    ending,
    glove_bytes,
    session_record,
    switch_bytes,
)
from thenar.runtime.recording.session import Collection, CollectionTask, Label, Session
from thenar.simulator.playing.performance import of_recording

_MESSAGE = Struct("<BQHIQQ")
_CLOCK_NS = 1_700_000_000_000_000_000
Message = tuple[int, int, bytes]


def _recording(session: Session, messages: Sequence[Message]) -> bytes:
    """Return a recording of messages (channel, microseconds, content) that was closed."""
    tail = Tail()
    data = beginning("0.1.0")
    tail.add_bytes(data)
    record = session_record(session)
    tail.add_bytes(record)
    tail.add_session(len(record))
    data += record
    for channel, time_us, content in messages:
        time_ns = _CLOCK_NS + 1000 * time_us
        length = _MESSAGE.size - 9 + len(content)
        record = _MESSAGE.pack(5, length, channel, tail.counts[channel], time_ns, time_ns) + content
        tail.add_bytes(record)
        tail.add_message(channel, time_ns)
        data += record
    return data + ending(tail)


def _collected() -> bytes:
    """Return a guided collection, calibrated: two trials, the second done again, and one of the empty hand."""
    lines = tuple(SensorCalibration(name, 40, 0.0, 200, 90.0) for name in SENSORS_18)
    tasks = tuple(CollectionTask(grasp, ("mug", "pen")) for grasp in (*GRASPS, "none"))
    session = Session(
        thenar="0.1.0",
        switches=SWITCHES,
        sensors=SENSORS_18,
        harness=GLOVE_TOML,
        calibration=GloveCalibration(sensors=lines),
        collection=Collection("anna", "own", GRASPS, tasks, 2, 5),
        clock_ns=_CLOCK_NS,
    )
    events = [(event, 1) for event in ("begun", "captured", "accepted")]
    events += [(event, 2) for event in ("captured", "redone", "captured", "accepted")]
    events += [(event, 3) for event in ("begun", "captured", "accepted")]
    messages: list[Message] = []
    for number, (event, trial) in enumerate(events):
        time_us = 120_000 * number
        label = Label(time_us + 2, event, trial, (*GRASPS, "none")[trial], "anna", "mug")  # type: ignore[arg-type]
        messages += [*_frames(time_us), (layout.TRIALS, label.time_us, encode_text(msgspec.json.encode(label)))]
    return _recording(session, messages)


def _frames(time_us: int) -> Iterator[Message]:
    glove = GloveFrame(time_us, bytes(range(60, 78)), 3)
    frame = SwitchFrame(time_us, closed=time_us // 1000 % 64, lost=0)
    yield layout.GLOVE, time_us, encode_bytes(glove_bytes(glove, 18))
    yield layout.SWITCHES, time_us + 1, encode_bytes(switch_bytes(frame, len(SWITCHES), 18))


def recognised() -> bytes:
    """Return a run of the build, with what it recognised."""
    build = loaded_build()
    names = tuple(switch.name for switch in build.manifest.switches)
    session = Session(
        thenar="0.1.0",
        switches=names,
        sensors=SENSORS_18,
        build=build.manifest.checksum,
        harness=GLOVE_TOML,
        clock_ns=_CLOCK_NS,
    )
    recognizer = LiveSystem.of(build, harness()).recognizer()
    messages: list[Message] = []
    for number in range(4):
        time_us = 10_000 * number
        glove = GloveFrame(time_us, bytes(range(60 + number, 78 + number)), 3)
        frame = SwitchFrame(time_us, closed=number % (1 << len(names)), lost=number == 2, glove=glove)
        found = recognizer.step(time_us + 5, _CLOCK_NS // 1000 + time_us, frame, glove).grasp
        messages += [
            (layout.GLOVE, time_us, encode_bytes(glove_bytes(glove, 18))),
            (layout.SWITCHES, time_us, encode_bytes(switch_bytes(frame, len(names), 18))),
            (layout.RECOGNITION, time_us + 5, encode_text(msgspec.json.encode(found))),
        ]
    return _recording(session, messages)


def _use(data: bytes, folder: Path) -> None:
    path = folder / "anna.mcap"
    path.write_bytes(data)
    refusals = []
    for step in STEPS:
        try:
            step(path)
        except (ThenarError, OSError) as refusal:
            refusals.append(refusal)
    if refusals:
        raise refusals[0]


def _imported(path: Path) -> None:
    import_recordings([path])


def _streamed(path: Path) -> None:
    import_recordings([path], stream=True)


def _resumed(path: Path) -> None:
    collection = read_journal(path).session.collection
    if collection is not None:
        planned(collection)


def _replayed(path: Path) -> None:
    for _ in replayed(loaded_build(), path):
        pass


def _played(path: Path) -> None:
    of_recording(path, 10_000)


# What is done with a recording.
STEPS = (_imported, _streamed, _resumed, _replayed, _played)
FORMATS = (Format("mcap", lambda: [_collected(), recognised()], mcap_file, _use),)
