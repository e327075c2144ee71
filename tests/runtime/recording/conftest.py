"""A session, and entries of every kind to record in it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.runtime.frames import GloveFrame, SwitchFrame, now_us
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.session import Collection, CollectionTask, Label, Session
from thenar.runtime.recording.writer import Recorder

Entry = SwitchFrame | GloveFrame | LiveGrasp | Label
Record = Callable[[Recorder, Entry], None]


@pytest.fixture
def session() -> Session:
    return Session(
        thenar="0.0.1",
        switches=tuple(f"s{number:03}" for number in range(12)),
        sensors=("thumb", "index"),
        build="ab" * 32,
        harness='name = "bänk"\n',
        calibration=GloveCalibration(
            subject="anna",
            sensors=(
                SensorCalibration("thumb", 100, 0.0, 200, 45.5),
                SensorCalibration("index", 200, 0.0, 50, 90.0),
            ),
        ),
        collection=Collection(
            "A", "own", ("cup", "pen"), (CollectionTask("cup", ("mug", "jar")), CollectionTask("pen", ("biro",))), 3, 7
        ),
    )


@pytest.fixture
def entries() -> list[Entry]:
    start = now_us()
    glove = GloveFrame(start + 20, b"\x01\xff", 3)
    return [
        SwitchFrame(start + 10, 0b1010, lost=1 << 11),
        glove,
        SwitchFrame(start + 25, 0b1, glove=glove),
        LiveGrasp(start + 30, 1, 0, "unknown", "cup", 0.0, 3, "degraded", 20, None, 10, ("s011",)),
        LiveGrasp(
            start + 40,
            2,
            1,
            "cup",
            "cup",
            0.75,
            3,
            "ok",
            30,
            20,
            10,
            state="held",
            segment=1,
            segment_type="cup",
            segment_us=start + 20,
            segment_probability=0.5,
        ),
        GloveFrame(start + 50, b"GS"),
        SwitchFrame(start + 60, 0),
        Label(start + 70, "captured", 1, "cup", "A", "mug"),
        Label(start + 80, "accepted", 1, "cup", "A", "mug"),
        SwitchFrame(start + 90, (1 << 12) - 1),
    ]


@pytest.fixture
def record() -> Record:
    def one(recorder: Recorder, entry: Entry) -> None:
        if isinstance(entry, SwitchFrame | GloveFrame):
            recorder.frame(entry)
        elif isinstance(entry, LiveGrasp):
            recorder.moment((), entry)
        else:
            recorder.label(entry)

    return one


@pytest.fixture
def recording(tmp_path: Path, session: Session, entries: list[Entry], record: Record) -> Path:
    """All entries, properly closed."""
    path = tmp_path / "whole.mcap"
    with Recorder(path, session) as recorder:
        for entry in entries:
            record(recorder, entry)
    return path
