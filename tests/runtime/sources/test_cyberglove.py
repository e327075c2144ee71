from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.drivers.emulated.cyberglove import CyberGloveBox, Doubts, EmulatedCyberGlove
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime import Build, Glove
from thenar.runtime.frames import GloveFrame
from thenar.runtime.harness.wiring import GloveWiring, Harness
from thenar.runtime.sources.cyberglove import GloveDevice

VALUES = bytes(range(60, 78))
SOME = ("index_mpj", "little_pij")


@pytest.fixture
def line(tmp_path: Path) -> Iterator[PtyLine]:
    with PtyLine(tmp_path / "port") as line:
        yield line


def opened(line: PtyLine, wiring: Callable[[GloveWiring], GloveWiring] = lambda wiring: wiring) -> GloveDevice:
    device = GloveDevice(wiring(GloveWiring(port=str(line.link))))
    device.read_only(SOME)
    device.open()
    return device


def first(device: GloveDevice) -> GloveFrame:
    frames = (device.read(1.0) for _ in range(10))
    return next(frame for frame in frames if frame is not None)


def test_a_frame_has_every_sensor_unrequested_ones_zero(line: PtyLine) -> None:
    with EmulatedCyberGlove(line) as emulated:
        emulated.set(VALUES)
        device = opened(line)
        wanted = [value if name in SOME else 0 for name, value in zip(SENSORS_18, VALUES, strict=True)]
        assert list(first(device).sensors) == wanted
        assert device.fault_message() == ""
        device.close()


def test_a_box_without_a_mask_delivers_all_and_is_in_trouble(line: PtyLine) -> None:
    with EmulatedCyberGlove(line, CyberGloveBox(doubts=Doubts(mask="ignored"))) as emulated:
        emulated.set(VALUES)
        device = opened(line)
        assert first(device).sensors == VALUES
        assert "it accepts no sensor mask" in device.fault_message()
        device.close()


@pytest.mark.parametrize(("mask", "record"), [(True, False), (False, False), (True, True)])
def test_a_run_reads_the_builds_joints_or_all_when_recording(
    line: PtyLine, make_build: Callable[..., Build], tmp_path: Path, mask: bool, record: bool
) -> None:
    build = make_build(switches=0)
    names = tuple({4: "j0", 7: "j1", 13: "j2"}.get(place, name) for place, name in enumerate(SENSORS_18))
    harness = Harness(name="one", cyberglove=GloveWiring(port=str(line.link), joints=names, mask=mask))
    with EmulatedCyberGlove(line) as emulated:
        emulated.set(VALUES)
        with Glove(build, harness, record=tmp_path / "run.mcap" if record else None) as glove:
            moment = next(moment for moment in glove if moment.codes is not None)
    assert moment.glove is not None
    few = mask and not record
    assert moment.glove.sensors == bytes(
        byte if not few or place in (4, 7, 13) else 0 for place, byte in enumerate(VALUES)
    )
    assert moment.codes == [VALUES[4], VALUES[7], VALUES[13]]
    assert moment.grasp.candidate == build.classify([], moment.codes)
