"""Recordings of no build: what a build makes of them is what it says of the frames themselves."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.drivers.errors import SettingError
from thenar.runtime.build import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.live.replay import recognised
from thenar.runtime.manifest import Calibration, Switch, Threshold
from thenar.runtime.recording.session import Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.taxels import TaxelCalibration

from ...gloves import pad_line

HARNESS = """
[[stream]]
port = "/dev/ttyACM0"
switches = ["a", "b"]
taxels = { pad = [0, 1023], heel = [0, 1023] }
"""
NEWTONS = Calibration(0, "pad", "N", 0, 0.0, 100, 1.0)
LINE = pad_line("pad", 100, 900, 2.0)


@pytest.fixture
def pressed(make_build: Callable[..., Build]) -> Build:
    """A build of a level of "pad" at half a newton, and the switch "b"."""
    build = make_build(seed=4, switches=2, joints=0)
    switches = Switch(0, "pad>60", 0.0, Threshold(60, 0.6, NEWTONS)), Switch(1, "b", 0.0)
    return Build(replace(build.manifest, checksum="1" * 64, switches=switches), build.tables)


def record(path: Path, frames: list[SwitchFrame], **changes: Any) -> Path:
    session = Session(thenar="0", harness=HARNESS, switches=("a", "b"), sensors=(), taxels=("pad", "heel"))
    calibration = TaxelCalibration(unit="N", sensors=(LINE,))
    with Recorder(path, replace(session, taxel_calibration=calibration, **changes)) as recorder:
        for frame in frames:
            recorder.frame(frame)
    return path


def test_levels_are_read_off_recorded_counts_and_switches_by_their_names(pressed: Build, tmp_path: Path) -> None:
    # Half a code above 0.6 N: at 400 counts a newton, from count 342 on 100 at rest.
    counts = (342, 343, 900, None, 100, 343)
    frames = [
        SwitchFrame(10_000 * number, number & 0b11, lost=0b01, taxels=(count, 7)) for number, count in enumerate(counts)
    ]
    moments = list(recognised(pressed, record(tmp_path / "all.mcap", frames)))
    assert len(moments) == len(frames)
    for moment, frame, count in zip(moments, frames, counts, strict=True):
        assert moment.switches is not None
        pad, b = count is not None and count > 342, bool(frame.closed & 2)
        assert (moment.switches.closed, moment.switches.lost) == (pad + 2 * b, count is None)
        if count is not None:
            found = pressed.recognise([pad, b], [])
            assert (moment.grasp.candidate, moment.grasp.margin, moment.grasp.lost) == (found.grasp, found.margin, ())


def test_no_moment_is_before_its_frames_whatever_their_order(pressed: Build, tmp_path: Path) -> None:
    """Frames of several devices are recorded as they arrive, not in the order of their times."""
    frames = [SwitchFrame(time_us, 0, taxels=(100, 7)) for time_us in (0, 10_000, 7_100, 20_000)]
    grasps = [moment.grasp for moment in recognised(pressed, record(tmp_path / "late.mcap", frames))]
    assert [grasp.time_us for grasp in grasps] == [0, 10_000, 10_000, 20_000]
    assert [grasp.latency_us for grasp in grasps] == [0] * 4


def test_a_taxel_that_was_not_recorded_is_named(pressed: Build, tmp_path: Path) -> None:
    path = record(tmp_path / "heel.mcap", [SwitchFrame(0, 0, taxels=(7,))], taxels=("heel",))
    with pytest.raises(SettingError, match=r"heel\.mcap was recorded without pad>60, which the build"):
        list(recognised(pressed, path))
