"""Streams of LSL, out of one outlet of this process and into another, on this machine alone."""

import time
from collections.abc import Callable
from importlib.util import find_spec
from itertools import count
from types import ModuleType
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.lsl import load_pylsl
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.published import JointAngles, LiveGrasp
from thenar.runtime.sinks import open_sink
from thenar.runtime.sources.lsl import LslReader

from ...conftest import tool
from ..conftest import row_source

names = count()
LONG_S = 20.0
GLOVE = """
[debounce]
enabled = false
[[stream]]
port = "lsl:{name}"
columns = ["thumb", "pad"]
switches = ["thumb"]
taxels = {{ pad = [0, 1] }}
"""


@pytest.fixture(scope="module")
def lsl() -> ModuleType:
    if find_spec("pylsl") is None:
        tool("pylsl of PyPI")
    return load_pylsl("test")


@pytest.fixture
def name() -> str:
    return f"thenar {time.monotonic_ns()} {next(names)}"


Outlet = Callable[..., Any]


@pytest.fixture
def outlet(lsl: ModuleType, name: str) -> Outlet:
    def made(channels: int, labels: list[str] | None = None, form: str = "float32") -> Any:
        info = lsl.StreamInfo(name, "Glove", channels, 100, form, name)
        if labels is not None:
            info.set_channel_labels(labels)
        return lsl.StreamOutlet(info)

    return made


@pytest.mark.parametrize("labels", [None, ["pad", "thumb"]])
def test_samples_are_rows_on_their_senders_clock(
    lsl: ModuleType, outlet: Outlet, name: str, labels: list[str] | None
) -> None:
    sender = outlet(2, labels)
    source = row_source(GLOVE.format(name=name))
    source.open()
    frames: list[SwitchFrame] = []
    began, end = lsl.local_clock(), time.monotonic() + LONG_S
    while len(frames) < 5:
        assert time.monotonic() < end
        sample = [1.0, 0.5] if labels is None else [0.5, 1.0]
        sender.push_sample(sample, began + len(frames) / 100)
        frame = source.read(0.05)
        frames += [frame] if isinstance(frame, SwitchFrame) else []
    assert {(frame.closed, frame.taxels) for frame in frames} == {(1, (2048,))}
    source.close()


def test_channels_with_other_labels_are_not_taken_by_their_order(outlet: Outlet, name: str) -> None:
    sender = outlet(2, ["finger", "palm"])
    source = row_source(GLOVE.format(name=name))
    source.open()
    end = time.monotonic() + LONG_S
    while not source.fault_message():
        assert time.monotonic() < end
        sender.push_sample([1.0, 0.5])
        assert source.read(0.05) is None
    assert source.fault_message() == "its rows have other columns than glove.toml: finger, palm, not thumb, pad"
    source.close()


def test_two_streams_of_one_name_are_said(outlet: Outlet, name: str) -> None:
    first = outlet(2)
    with LslReader(f"lsl:{name}") as reader:
        reader.open()
        assert reader.other_sender() == ""
        second = outlet(2)
        end = time.monotonic() + LONG_S
        while not reader.other_sender():
            assert time.monotonic() < end
            reader.read(0.05)
        assert reader.other_sender() == "2 LSL streams have this name, and one of them is read: rename the others"
    del first, second


@pytest.mark.parametrize("stamp", [float("nan"), float("inf"), 1e305])
def test_a_sample_whose_stamp_is_no_time_is_left_out(lsl: ModuleType, outlet: Outlet, name: str, stamp: float) -> None:
    sender = outlet(2)
    source = row_source(GLOVE.format(name=name))
    source.open()
    frames, end = 0, time.monotonic() + LONG_S
    counts: dict[str, int] = {}
    while not (frames and counts.get("untimed")):
        assert time.monotonic() < end
        sender.push_sample([0.0, 0.5], stamp)
        sender.push_sample([1.0, 0.5], lsl.local_clock())
        frame = source.read(0.05)
        if isinstance(frame, SwitchFrame):
            assert frame.closed == 1
            frames += 1
        counts = {count.name: count.value for count in source.counts()}
    source.close()


def test_a_stream_that_is_not_there_or_holds_texts_is_said(outlet: Outlet, name: str) -> None:
    with pytest.raises(DeviceError, match="no LSL stream of this name"):
        LslReader(f"lsl:{name}").open()
    texts = outlet(1, None, "string")
    with pytest.raises(SettingError, match="a stream of texts"):
        LslReader(f"lsl:{name}").open()
    del texts
    with pytest.raises(SettingError, match="names no stream"):
        LslReader("lsl:").open()


def test_grasps_and_angles_go_out_as_streams(lsl: ModuleType, name: str, make_grasp: Callable[..., LiveGrasp]) -> None:
    sink = open_sink(f"lsl:{name}")
    grasp, angles = make_grasp(100, "cup"), JointAngles(("index", "ring"), (0.5, 0.25))
    sink.publish(grasp, None, angles)
    inlets = []
    for called in (name, f"{name}-angles"):
        (found,) = lsl.resolve_byprop("name", called, 1, LONG_S)
        inlets.append(lsl.StreamInlet(found, recover=False))
        inlets[-1].open_stream(LONG_S)
    assert inlets[1].info().get_channel_labels() == ["index", "ring"]
    for number, held in enumerate(("pen", "pen", "rod"), start=1):
        now = replace(grasp, grasp=held, time_us=grasp.time_us + 1000 * number)
        sink.publish(now, None, JointAngles(angles.names, (0.5, 0.25 * number)))
    got = [inlets[0].pull_sample(LONG_S) for _ in range(2)]
    assert [(sample[0], round(stamp * 1e6)) for sample, stamp in got] == [
        ("pen", grasp.time_us + 1000),
        ("rod", grasp.time_us + 3000),
    ]
    assert [inlets[1].pull_sample(LONG_S)[0] for _ in range(3)] == [[0.5, 0.25], [0.5, 0.5], [0.5, 0.75]]
    sink.close()
    with pytest.raises(SettingError, match="is not a valid stream name"):
        open_sink("lsl:a\x1bb")
