"""What an emulated glove plays of a live recording."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.published import UNKNOWN, LiveGrasp
from thenar.runtime.recording.messages import switch_matrix
from thenar.runtime.recording.reader import Reader, check_made
from thenar.runtime.recording.session import Label

from ..errors import SceneError
from .performance import Performance, resting, typical

# The switches, the sensors, and the grasp type of one moment.
Moment = tuple[int, bytes, str]


def of_recording(path: Path, period_us: int, warn: Callable[[str], None] = lambda _: None) -> Performance:
    """Return the newest frames of a recording every `period_us`, with the grasp type recognised, or collected, by then.

    Where there was no CyberGlove its sensors rest. `warn` takes a sentence on each fault of the file. Raises McapError
    if it is no recording, SceneError if it holds no frames.
    """
    reader = Reader(path)
    calibration = reader.session.calibration or typical()
    rows = list(_ticks(reader, resting(calibration).tobytes(), period_us))
    for fault in reader.faults():
        warn(fault.message)
    if not rows:
        raise SceneError(f"{path.name}: holds no frame of a glove")
    names = reader.session.switches
    assert reader.end is not None
    width = len(names) + len(rows[0][1]) + 4 * max(len(grasp) for _, _, grasp in rows)
    check_made(f"{path.name}: what it plays", len(rows) * width, reader.end.size)
    return Performance(
        switches=switch_matrix([closed for closed, _, _ in rows], len(names)),
        switch_names=names,
        sensors=np.frombuffer(b"".join(sensors for _, sensors, _ in rows), np.uint8).reshape(len(rows), -1),
        grasps=np.array([grasp for _, _, grasp in rows]),
        period_us=period_us,
        calibration=calibration,
    )


def _ticks(reader: Reader, rest: bytes, period_us: int) -> Iterator[Moment]:
    """Yield a moment every `period_us`, from when all devices that the recording names have been read."""
    closed: int | None = 0 if not reader.session.switches else None
    sensors: bytes | None = rest if not reader.session.sensors else None
    grasp, due_us = UNKNOWN, None
    for entry in reader:
        if isinstance(entry, SwitchFrame):
            closed = entry.closed
        elif isinstance(entry, GloveFrame):
            sensors = entry.sensors
        elif isinstance(entry, LiveGrasp | Label):
            grasp = entry.grasp
        else:
            continue
        if closed is None or sensors is None:
            continue
        if due_us is None:
            due_us = entry.time_us
        if entry.time_us >= due_us:
            yield closed, sensors, grasp
            due_us += period_us
