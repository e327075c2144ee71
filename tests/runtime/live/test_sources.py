"""Devices that are kept, and what arrives of them, joined."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from queue import Queue
from threading import Event, Thread

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thenar.drivers.errors import DeviceError, SettingError
from thenar.runtime import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame, now_us
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.harness.wiring import Harness, StreamWiring
from thenar.runtime.live import sources as module
from thenar.runtime.live.recogniser import LiveRecognizer
from thenar.runtime.live.sources import DeviceThread, FrameBuffer, Sources
from thenar.runtime.live.system import LiveSystem
from thenar.runtime.policy import Policy
from thenar.runtime.published import LiveGrasp
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources.base import SOURCES, Source, SourceKind
from thenar.runtime.taxels import TaxelCalibration

from ...gloves import pad_line
from ...sending import datagrams, free_port

MakeBuild = Callable[..., Build]
PERIOD_US = 10_000_000
LONGEST_US = 2 * PERIOD_US


LOW, HIGH, NOBODYS = 0b0011, 0b1100, 0b10000

times, limits = st.integers(0, 100), st.integers(0, 100)
Joined = Callable[..., SwitchFrame | None]


@pytest.fixture
def joined(monkeypatch: pytest.MonkeyPatch) -> Joined:
    """Return the frames of parts that came (when, part, frame, for how long it counts), as one at a later time."""

    def at(
        switches: int, owned: Sequence[int], frames: Sequence[tuple[int, int, SwitchFrame, int]], now: int
    ) -> SwitchFrame | None:
        arrivals, clock = FrameBuffer(switches, owned), [0]
        with monkeypatch.context() as patched:
            patched.setattr(module, "now_us", lambda: clock[0])
            for clock[0], part, frame, longest_us in frames:
                arrivals.put_switches(part, frame, longest_us)
            clock[0] = now
            return arrivals.take().switches

    return at


def made() -> FrameBuffer:
    return FrameBuffer(3, [0b111])


def switches_only(make_build: MakeBuild, period_us: int) -> LiveRecognizer:
    """A recogniser of six switches that answers as long as one of them is read."""
    policy = Policy(max_lost=0.99)
    return LiveRecognizer(make_build(joints=0), switch_period_us=period_us, policy=policy)


def test_what_arrived_is_taken_once_and_in_order() -> None:
    arrivals = made()
    assert arrivals.take().arrived == ()
    first, glove, second = SwitchFrame(now_us(), 0b001), GloveFrame(now_us(), b"abc"), SwitchFrame(now_us(), 0b110)
    arrivals.put_switches(0, first, LONGEST_US)
    arrivals.put_glove(glove, LONGEST_US)
    arrivals.put_switches(0, second, LONGEST_US)
    taken = arrivals.take()
    assert (taken.switches, taken.glove, taken.arrived) == (second, glove, (first, glove, second))
    again = arrivals.take()
    assert (again.switches, again.glove, again.arrived) == (second, glove, ())


def test_waiting_ends_when_something_comes_and_not_before() -> None:
    arrivals = made()
    assert not arrivals.take().arrived
    bringing = Thread(target=lambda: arrivals.put_switches(0, SwitchFrame(now_us(), 0b1), LONGEST_US))
    bringing.start()
    assert arrivals.take(lambda: PERIOD_US).arrived
    bringing.join()
    assert not arrivals.take().arrived
    assert not arrivals.take(lambda: PERIOD_US, 1).arrived


def test_of_more_frames_than_are_kept_the_newest_are() -> None:
    arrivals = made()
    frames = [GloveFrame(number, b"abc") for number in range(5000)]
    for frame in frames:
        arrivals.put_glove(frame, LONGEST_US)
    assert arrivals.take().arrived == tuple(frames[-4096:])
    assert arrivals.overflowed == 5000 - 4096
    arrivals.put_switches(0, SwitchFrame(now_us(), 0b1), LONGEST_US)
    assert arrivals.overflowed == 5000 - 4096


def test_silent_parts_are_lost_once_without_any_arrival(make_build: MakeBuild, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two boards at 1 kHz under a recogniser that waits 20 ms: one falls silent, then the other."""
    clock, live = [50_000], switches_only(make_build, 10_000)
    monkeypatch.setattr(module, "now_us", lambda: clock[0])
    arrivals = FrameBuffer(6, [0b000111, 0b111000])

    def step(now: int) -> LiveGrasp:
        clock[0] = now
        taken = arrivals.take()
        assert arrivals.take().arrived == ()
        return live.step(now, 0, taken.switches, None).grasp

    arrivals.put_switches(0, SwitchFrame(50_000, 0b101), 2000)
    arrivals.put_switches(1, SwitchFrame(49_500, 0b011000), 2000)
    whole = step(51_500)
    assert whole.health == "ok"
    degraded = step(51_501)
    assert (degraded.health, degraded.lost, degraded.grasp) == ("degraded", ("s3", "s4", "s5"), whole.grasp)
    for now in (52_001, 53_000, 69_999, 70_001, 80_000):
        gone = step(now)
        assert (gone.health, len(gone.lost), gone.candidate) == ("unknown", 6, "unknown")


def test_a_silent_bus_does_not_take_a_living_glove_down_with_it(make_build: MakeBuild) -> None:
    build = make_build()
    arrivals = FrameBuffer(6, [0b111111])
    names = ("j0", "j1", "j2")
    recognizer = LiveRecognizer(build, sensor_names=names, switch_period_us=PERIOD_US, glove_period_us=PERIOD_US)
    now = now_us()
    ended_by = GloveFrame(now, b"\x10\x20\x30")
    arrivals.put_glove(ended_by, LONGEST_US)
    assert recognizer.step(now, 0, SwitchFrame(now, 0b101, glove=ended_by), ended_by).grasp.health == "ok"
    for _ in range(5):
        now += PERIOD_US
        arrivals.put_glove(GloveFrame(now, b"\x10\x20\x30"), LONGEST_US)
        grasp = recognizer.step(now, 0, SwitchFrame(now_us(), 0b101, glove=ended_by), arrivals.take().glove).grasp
    assert grasp.glove_age_us == 0
    assert set(grasp.lost) == {switch.name for switch in build.manifest.switches}


def test_what_is_fresh_is_so_until_it_expires(monkeypatch: pytest.MonkeyPatch) -> None:
    arrivals, clock = FrameBuffer(2, [0b01, 0b10]), [1000]
    monkeypatch.setattr(module, "now_us", lambda: clock[0])

    def fresh_for_us(now: int) -> int | None:
        clock[0] = now
        arrivals.take()
        return arrivals.fresh_for_us(now)

    assert fresh_for_us(1000) is None
    arrivals.put_switches(0, SwitchFrame(1000, 0), 800)
    assert fresh_for_us(1100) == 701
    clock[0] = 1090
    arrivals.put_switches(1, SwitchFrame(1050, 0), 200)
    assert fresh_for_us(1100) == 151
    arrivals.put_glove(GloveFrame(1090, b"abc"), 100)
    assert fresh_for_us(1100) == 91
    assert fresh_for_us(1250) == 1
    assert fresh_for_us(1251) == 550
    assert fresh_for_us(1801) is None


def test_the_gloves_record_is_a_measurement_until_it_expires(monkeypatch: pytest.MonkeyPatch) -> None:
    arrivals, clock = made(), [1000]
    monkeypatch.setattr(module, "now_us", lambda: clock[0])
    record = GloveFrame(990, b"abc")
    arrivals.put_glove(record, 100)
    for now, measured in ((1000, record), (1090, record), (1091, None)):
        clock[0] = now
        taken = arrivals.take()
        assert (taken.glove, taken.measured) == (record, measured)


def test_a_part_alone_that_owns_everything_is_handed_on_as_it_is(joined: Joined) -> None:
    frame = SwitchFrame(5, 0b01, 0b10, GloveFrame(3, b"x"))
    assert joined(2, [LOW], [(6, 0, frame, LONGEST_US)], 6) is frame


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.tuples(times, times), st.tuples(limits, limits), times)
def test_a_parts_inputs_are_lost_when_its_frame_expires(
    joined: Joined, read_us: tuple[int, int], longest_us: tuple[int, int], later_us: int
) -> None:
    """All of it when all have; and the time never falls, or whoever takes the frames would keep the one before."""
    parts = zip(read_us, (0b0001, 0b1000), longest_us, strict=True)
    frames = sorted(
        (read, part, SwitchFrame(read, closed), longest) for part, (read, closed, longest) in enumerate(parts)
    )
    now = max(read_us) + later_us
    low, high = (now - read <= longest for read, longest in zip(read_us, longest_us, strict=True))
    lost = NOBODYS | LOW * (not low) | HIGH * (not high)
    assert joined(5, [LOW, HIGH], frames, now) == SwitchFrame(max(read_us), 0b0001 * low | 0b1000 * high, lost)


def test_a_frame_from_the_future_expires_from_its_arrival(joined: Joined) -> None:
    frames = [(100, 0, SwitchFrame(10**9, 0b01), LONGEST_US)]
    for now, lost in ((100 + LONGEST_US, 0), (101 + LONGEST_US, LOW)):
        found = joined(2, [LOW], frames, now)
        assert found is not None
        assert found.lost == lost


def test_a_part_that_has_not_come_yet_is_lost(joined: Joined) -> None:
    both = joined(5, [LOW, HIGH], [(9, 1, SwitchFrame(9, 0b1000), LONGEST_US)], 10)
    assert both == SwitchFrame(9, 0b1000, lost=LOW | NOBODYS)


LONG_S = 10.0


class Device(Source):
    """Hands out what the test puts in, one thing a reading; an exception is raised."""

    def __init__(self) -> None:
        self.samples: Queue[SwitchFrame | Exception] = Queue()
        self.openings: Queue[Exception | None] = Queue()
        self.closed = Event()

    def open(self) -> None:
        wrong = self.openings.get(timeout=LONG_S)
        if wrong is not None:
            raise wrong

    def read(self, timeout_s: float) -> SwitchFrame | None:
        if self.samples.empty():
            self.closed.wait(0.001)
            return None
        sample = self.samples.get()
        if isinstance(sample, Exception):
            raise sample
        return sample

    def close(self) -> None:
        self.closed.set()


class Kept:
    def __init__(self) -> None:
        self.device = Device()
        self.taken: Queue[SwitchFrame | GloveFrame] = Queue()
        self.changes: Queue[tuple[bool, str]] = Queue()
        self.keeper = DeviceThread("thing", self.device, self.taken.put, self._changed)
        self.keeper.start()

    def _changed(self) -> None:
        self.changes.put((self.keeper.state.connected, self.keeper.state.error))

    def next_change(self) -> tuple[bool, str]:
        return self.changes.get(timeout=LONG_S)


@pytest.fixture
def kept() -> Iterator[Kept]:
    one = Kept()
    yield one
    one.device.openings.put(None)
    one.keeper.close()


def test_every_sample_is_taken_in_order(kept: Kept) -> None:
    kept.device.openings.put(None)
    for number in range(100):
        kept.device.samples.put(SwitchFrame(number, 0))
    assert [kept.taken.get(timeout=LONG_S) for _ in range(100)] == [SwitchFrame(number, 0) for number in range(100)]
    assert kept.next_change() == (True, "")


def test_a_lost_device_is_closed_and_reopened_and_reported(kept: Kept) -> None:
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    kept.device.samples.put(DeviceError("the cable is out"))
    assert kept.next_change() == (False, "the cable is out")
    assert kept.device.closed.wait(LONG_S)
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    kept.device.samples.put(SwitchFrame(7, 0))
    assert kept.taken.get(timeout=LONG_S) == SwitchFrame(7, 0)
    assert kept.keeper.opened == 2


def test_failing_again_in_the_same_way_is_no_news(kept: Kept) -> None:
    for _ in range(3):
        kept.device.openings.put(DeviceError("nothing there"))
    kept.device.openings.put(None)
    assert kept.next_change() == (False, "nothing there")
    assert kept.next_change() == (True, "")
    assert kept.keeper.failure is None


def test_what_no_try_can_help_ends_it(kept: Kept) -> None:
    wrong = SettingError("such a glove there is not")
    kept.device.openings.put(wrong)
    assert kept.next_change() == (False, "such a glove there is not")
    kept.keeper.close()
    assert kept.keeper.failure is wrong


def test_closing_does_not_wait_for_an_opening_that_hangs(kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_CLOSE_S", 0.01, raising=False)
    kept.keeper.close()
    assert not kept.device.closed.is_set()
    kept.device.openings.put(None)
    assert kept.device.closed.wait(LONG_S)


def test_what_a_device_could_do_before_is_tried_again(kept: Kept) -> None:
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    kept.device.samples.put(SettingError("an answer that the cable garbled"))
    assert kept.next_change() == (False, "an answer that the cable garbled")
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    assert kept.keeper.failure is None


def test_a_program_fault_is_traced_counted_and_survived(kept: Kept, caplog: pytest.LogCaptureFixture) -> None:
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    for _ in range(3):  # one amid reading, two while it is opened again
        kept.device.samples.put(ZeroDivisionError("oops"))
        kept.device.openings.put(ZeroDivisionError("oops"))
    assert kept.next_change() == (False, "ZeroDivisionError: oops")
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    assert kept.keeper.faults >= 3
    traces = [record for record in caplog.records if record.name == "thenar" and record.exc_info]
    assert "thing" in traces[0].getMessage()
    assert "ZeroDivisionError: oops" in caplog.text
    assert "Traceback" in caplog.text


def test_a_fault_after_each_opening_is_logged_once(kept: Kept, caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(3):
        kept.device.openings.put(None)
        assert kept.next_change() == (True, "")
        kept.device.samples.put(ZeroDivisionError("oops"))
        assert kept.next_change() == (False, "ZeroDivisionError: oops")
    assert kept.keeper.faults == 3
    assert len([record for record in caplog.records if record.exc_info]) == 1


def test_a_source_of_ones_own_is_told_the_switches_whenever_it_is_made(
    make_build: MakeBuild, monkeypatch: pytest.MonkeyPatch
) -> None:
    build, told = make_build(joints=2), list[tuple[str, ...]]()

    def sources(_harness: Harness, names: Sequence[str], *_: object) -> Iterator[Source]:
        told.append(tuple(names))
        yield from ()

    monkeypatch.setattr(SOURCES, "_members", {"own": SourceKind("own", sources)})
    names = tuple(switch.name for switch in build.manifest.switches)
    stream = StreamWiring(port="-", columns=names, switches=names)
    system = LiveSystem.of(build, Harness(name="own", streams=(stream,)))
    assert "nothing in 'own' reads the build's joints" in system.unread
    system.recognizer()
    with Sources(system.harness, system.switch_names, system.scan):
        assert told == [names] * 3


def test_devices_know_the_calibration_of_taxels_that_glove_toml_names(tmp_path: Path) -> None:
    lines = (pad_line("pad", rest=50, press=600),)
    (tmp_path / "taxels.toml").write_text(TaxelCalibration(sensors=lines).to_toml())
    text = 'columns = ["pad"]\ntaxels = { pad = [0, 1023] }\n[taxels]\ncalibration = "taxels.toml"\n'
    (tmp_path / "glove.toml").write_text(f'[[stream]]\nport = "udp://127.0.0.1:{(port := free_port())}"\n{text}')
    harness = load_harness(tmp_path / "glove.toml")
    with (
        Sources(harness, (), whole_scan(harness, (), every_taxel=True)) as sources,
        datagrams(port, lambda _: b"1023\n"),
    ):
        while (frame := sources.take().switches) is None:
            pass
        assert frame.taxels == (1023,)
        assert sources.health()[0].error == "taxels with faults: pad: saturated"
