from pathlib import Path

import numpy as np
import pytest

from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.session import Label, Session
from thenar.runtime.recording.writer import Recorder
from thenar.simulator.errors import SceneError
from thenar.simulator.playing.performance import of_recording, resting, typical

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
