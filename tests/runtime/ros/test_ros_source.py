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
from typing import Any

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources.base import SOURCES
from thenar.runtime.sources.ros import RosReader
from thenar.runtime.sources.rows import RowSource

DOMAIN = 78
TALKER = Path(__file__).with_name("ros_talker.py")
names = count()
Hear = Callable[[str, str, Any, str], tuple[RowSource, list[SwitchFrame | GloveFrame]]]


@pytest.fixture
def hear(ros: ModuleType, monkeypatch: pytest.MonkeyPatch) -> Iterator[Hear]:
    """Return a source of the harness, and the frames of the first row that it makes of messages of such values."""
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    # The other process keeps to loopback as well, by the same settings.
    from thenar.runtime.ros import domain

    with ExitStack() as stack:

        def heard(kind: str, options: str, values: Any, text: str) -> tuple[RowSource, list[SwitchFrame | GloveFrame]]:
            topic = f"/hand{time.monotonic_ns()}n{next(names)}"
            monkeypatch.setenv("CYCLONEDDS_URI", domain._LOOPBACK)
            harness = parse_harness(text.format(port=f"ros:{topic}{options}"), "glove.toml")
            scan = whole_scan(harness, harness.switches, every_taxel=True)
            made = [source for kind in SOURCES.values() for source in kind.sources(harness, harness.switches, scan)]
            (source,) = made
            assert isinstance(source, RowSource)
            stack.callback(source.close)
            source.open()
            command = [sys.executable, str(TALKER), topic, kind, str(DOMAIN)]
            process = stack.enter_context(
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
            )
            stack.callback(process.kill)
            assert process.stdin is not None
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            end, frames = time.monotonic() + 20, list[SwitchFrame | GloveFrame]()
            while not frames and not source.reader.counts().misfits:
                assert time.monotonic() < end
                process.stdin.write(json.dumps(values) + "\n")
                frame = source.read(0.05)
                while frame is not None:
                    frames.append(frame)
                    frame = source.read(0) if source._ready else None
            return source, frames

        yield heard


def test_positions_of_a_joint_state_are_joints_by_their_names(hear: Hear) -> None:
    text = '[[stream]]\nport = "{port}"\njoints = {{ ring = [0, 2], index = [-1, 1] }}\n'
    values = {"stamp": [1_800_000_000, 5], "name": ["index", "more", "ring"], "position": [1.0, 9.0, 1.0]}
    source, frames = hear("JointState", "", values, text)
    assert isinstance(frames[0], GloveFrame)
    assert frames[0].sensors == bytes((128, 255))
    assert source.owned == 0


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
    assert source.trouble() == "the data holds no rows: a JointState of 2 names and 1 positions"


@pytest.mark.parametrize("port", ["ros:", "ros:topic", "ros:/t?type=String", "ros:/a b", "ros:/t?x"])
def test_what_is_no_topic_is_refused(ros: ModuleType, port: str) -> None:
    with pytest.raises(SettingError):
        RosReader(port).open()
