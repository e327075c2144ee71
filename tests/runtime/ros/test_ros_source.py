"""Topics of ROS 2 as a source, written by another process that knows their types from elsewhere (ros_talker.py)."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import IO, Any

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.stream_probe import propose_glove
from thenar.runtime.sources.ros import RosReader
from thenar.runtime.sources.rows import RowSource

from ...sending import sending
from ..conftest import row_source

DOMAIN = 78
TALKER = Path(__file__).with_name("ros_talker.py")
names = count()
Talk = Callable[[str, str], IO[str]]
Hear = Callable[[str, str, Any, str], tuple[RowSource, list[SwitchFrame | GloveFrame]]]


def _topic() -> str:
    return f"/hand{time.monotonic_ns()}n{next(names)}"


@pytest.fixture
def talk(ros: ModuleType, monkeypatch: pytest.MonkeyPatch) -> Iterator[Talk]:
    """Return what starts a process that sends a message of a topic for each line of values."""
    # The other process keeps to loopback as well, by the same settings.
    monkeypatch.setenv("CYCLONEDDS_URI", ros._LOOPBACK)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    with ExitStack() as stack:

        def started(topic: str, kind: str) -> IO[str]:
            command = [sys.executable, str(TALKER), topic, kind, str(DOMAIN)]
            process = stack.enter_context(
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
            )
            stack.callback(process.kill)
            assert process.stdin is not None
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            return process.stdin

        yield started


@pytest.fixture
def hear(talk: Talk) -> Iterator[Hear]:
    """Return a source of the harness, and the frames of the first row that it makes of messages of such values."""
    with ExitStack() as stack:

        def heard(kind: str, options: str, values: Any, text: str) -> tuple[RowSource, list[SwitchFrame | GloveFrame]]:
            topic = _topic()
            source = row_source(text.format(port=f"ros:{topic}{options}"))
            stack.callback(source.close)
            source.open()
            sending = talk(topic, kind)
            end, frames = time.monotonic() + 20, list[SwitchFrame | GloveFrame]()
            while not frames and not source.reader.counts().misfits:
                assert time.monotonic() < end
                sending.write(json.dumps(values) + "\n")
                frame = source.read(0.05)
                while frame is not None:
                    frames.append(frame)
                    frame = source.read(0) if source._ready else None
            return source, frames

        yield heard


def test_messages_of_a_second_publisher_are_left_out_and_said(talk: Talk) -> None:
    topic = _topic()
    source = row_source(f'[[stream]]\nport = "ros:{topic}"\njoints = {{ ring = [1, 255] }}\n')
    source.open()
    try:
        first, second = talk(topic, "JointState"), talk(topic, "JointState")
        end, frame = time.monotonic() + 20, None
        for place in count():
            assert time.monotonic() < end
            sent = {"stamp": [1_800_000_000, 1000 * place], "name": ["ring"]}
            first.write(json.dumps(sent | {"position": [40.0]}) + "\n")
            if frame is not None:
                second.write(json.dumps(sent | {"position": [200.0]}) + "\n")
            new = source.read(0.05)
            assert new is None or (isinstance(new, GloveFrame) and new.sensors == bytes((40,)))
            frame = new or frame
            if source.reader.counts().foreign:
                break
        assert source.fault_message().startswith(
            "another publisher sends on this topic, too, and its messages are left out"
        )
    finally:
        source.close()


def test_a_joint_that_is_renamed_is_lost_and_said(hear: Hear) -> None:
    text = '[[stream]]\nport = "{port}"\njoints = {{ ring = [0, 2], index = [-1, 1] }}\n'
    source, frames = hear("JointState", "", {"stamp": [0, 0], "name": ["idx", "ring"], "position": [1.0, 1.0]}, text)
    assert isinstance(frames[0], GloveFrame)
    assert frames[0].sensors == bytes((128, 0))
    assert source.fault_message() == "its rows lack index: name columns in glove.toml as it does"


def test_positions_of_a_joint_state_are_joints_by_their_names(hear: Hear) -> None:
    text = '[[stream]]\nport = "{port}"\njoints = {{ ring = [0, 2], index = [-1, 1] }}\n'
    values = {"stamp": [1_800_000_000, 5], "name": ["index", "more", "ring"], "position": [1.0, 9.0, 1.0]}
    source, frames = hear("JointState", "", values, text)
    assert isinstance(frames[0], GloveFrame)
    assert frames[0].sensors == bytes((128, 255))
    assert source.owned == 0


@pytest.mark.parametrize("kind", ["JointState", "Float32MultiArray"])
def test_doctor_proposes_joints_for_a_joint_state_whatever_their_names_and_values(talk: Talk, kind: str) -> None:
    topic = _topic()
    talking = talk(topic, kind)

    def send(place: int) -> None:
        positions = [float(place % 2), 0.25 * (place % 5), 0.5 if kind == "JointState" else 0.5 * (place % 2)]
        stamped = {"stamp": [1_800_000_000, place], "name": ["ring", "thumb", "fsr"], "position": positions}
        talking.write(json.dumps(stamped if kind == "JointState" else positions) + "\n")

    with sending(send):
        found = propose_glove(f"ros:{topic}?type={kind}", 115_200, 0.5).harness.streams[0]
    if kind == "JointState":
        assert list(found.joints) == ["ring", "thumb", "fsr"]
        assert not found.switches
        assert not found.taxels
    else:
        assert (found.switches, list(found.taxels)) == (("c1",), ["c2", "c3"])


def test_numbers_of_an_array_are_columns_in_their_order(hear: Hear) -> None:
    text = (
        '[[stream]]\nport = "{port}"\ncolumns = ["thumb", "", "pad"]\nswitches = ["thumb"]\n'
        "taxels = {{ pad = [0, 255] }}\n[debounce]\nenabled = false\n"
    )
    for kind, values in (("UInt8MultiArray", [1, 7, 200]), ("Float32MultiArray", [0.75, 0.0, 200.0])):
        _, frames = hear(kind, f"?type={kind}", values, text)
        assert isinstance(frames[0], SwitchFrame)
        assert (frames[0].closed, frames[0].lost, frames[0].taxels) == (1, 0, (200,))


def test_a_joint_state_of_names_without_positions_is_counted(hear: Hear) -> None:
    text = '[[stream]]\nport = "{port}"\njoints = {{ a = [0, 1] }}\n'
    source, frames = hear("JointState", "", {"stamp": [0, 0], "name": ["a", "b"], "position": [1.0]}, text)
    assert not frames
    assert source.fault_message() == "the data holds no rows: a JointState of 2 names and 1 positions"


@pytest.mark.parametrize("port", ["ros:", "ros:topic", "ros:/t?type=String", "ros:/a b", "ros:/t?x"])
def test_what_is_no_topic_is_refused(ros: ModuleType, port: str) -> None:
    with pytest.raises(SettingError):
        RosReader(port).open()
