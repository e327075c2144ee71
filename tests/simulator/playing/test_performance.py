from itertools import pairwise
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from thenar.drivers.calibration import GloveCalibration
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.session import Label, Session
from thenar.runtime.recording.writer import Recorder
from thenar.simulator.errors import SceneError
from thenar.simulator.playing.performance import Performance, of_recording, resting, typical


def performance(frames: int, period_us: int) -> Performance:
    random = np.random.default_rng(1)
    return Performance(
        switches=random.random((frames, 3)) < 0.5,
        switch_names=("a", "b", "c"),
        sensors=random.integers(1, 256, (frames, 18)).astype(np.uint8),
        grasps=np.array([f"g{number}" for number in range(frames)]),
        period_us=period_us,
        calibration=GloveCalibration(sensors=(), unit="deg", subject=""),
    )


def test_every_frame_is_shown_once_in_order_and_never_early() -> None:
    played, shown, log = performance(20, 2000), list[tuple[list[bool], bytes]](), list[tuple[int, str, int]]()
    assert played.play(lambda bits, raw, *_: shown.append((bits, raw)), lambda *line: log.append(line), Event())
    assert [bits for bits, _ in shown] == played.switches.tolist()
    assert [raw for _, raw in shown] == [row.tobytes() for row in played.sensors]
    assert [(row, grasp) for row, grasp, _ in log] == list(enumerate(played.grasps.tolist()))
    start = log[0][2]
    assert all(time_us >= start + (row - 1) * 2000 for row, _, time_us in log)
    assert all(earlier[2] <= later[2] for earlier, later in pairwise(log))


def test_stopping_ends_it_at_once_and_it_says_so() -> None:
    stop = Event()
    played = performance(1000, 60_000_000)
    assert not played.play(lambda *_: stop.set(), lambda *_: None, stop)


NAMES = ("a", "b", "c")


def session(sensors: tuple[str, ...] = SENSORS_18) -> Session:
    return Session(thenar="0", switches=NAMES, sensors=sensors)


def raw(first: int) -> bytes:
    return bytes([first] * 18)


def test_playing_starts_once_both_devices_were_read(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(path, session()) as recorder:
        recorder.frame(SwitchFrame(0, 0b001))
        recorder.frame(GloveFrame(5_000, raw(7)))
        recorder.moment((), LiveGrasp(5_000, 0, 0, "PoS", "PoS", 1.0, 9, "ok", 0, 0, 0))
        recorder.frame(SwitchFrame(12_000, 0b110))
        recorder.frame(GloveFrame(15_500, raw(8)))
        recorder.frame(GloveFrame(26_000, raw(9)))
    played = of_recording(path, 10_000)
    assert played.switch_names == NAMES
    assert played.switches.tolist() == [[True, False, False], [False, True, True], [False, True, True]]
    assert played.sensors[:, 0].tolist() == [7, 8, 9]
    assert played.grasps.tolist() == ["unknown", "PoS", "PoS"]
    assert played.calibration == typical()


def test_a_guided_collection_is_played_with_its_labels(tmp_path: Path) -> None:
    path = tmp_path / "collected.mcap"
    with Recorder(path, session()) as recorder:
        recorder.frame(SwitchFrame(0, 0b001))
        recorder.frame(GloveFrame(0, raw(7)))
        recorder.label(Label(time_us=20_000, event="captured", trial=1, grasp="Tip", subject="A", object="pen"))
        recorder.frame(GloveFrame(31_000, raw(8)))
    assert of_recording(path, 10_000).grasps.tolist() == ["unknown", "Tip", "Tip"]


def test_without_a_cyberglove_its_sensors_rest(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(path, session(sensors=())) as recorder:
        recorder.frame(SwitchFrame(0, 0b001))
    played = of_recording(path, 10_000)
    assert np.array_equal(played.sensors, resting(typical())[np.newaxis])


def test_a_recording_without_frames_cannot_be_played(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(path, session()) as recorder:
        recorder.frame(SwitchFrame(0, 0b001))
    with pytest.raises(SceneError, match=r"run\.mcap: holds no glove frames"):
        of_recording(path, 10_000)
