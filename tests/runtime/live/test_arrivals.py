from collections.abc import Callable
from threading import Thread

import pytest

import thenar.runtime.live.arrivals
from thenar.runtime import Build
from thenar.runtime.live.arrivals import Arrivals
from thenar.runtime.live.frames import GloveFrame, SwitchFrame, now_us
from thenar.runtime.live.joiner import LiveRecognizer
from thenar.runtime.live.parts import Part, Parts
from thenar.runtime.live.policy import Policy
from thenar.runtime.live.published import LiveGrasp

MakeBuild = Callable[..., Build]
PERIOD_US = 10_000_000
LONGEST_US = 2 * PERIOD_US


def made() -> tuple[Arrivals, Part]:
    part = Part(0b111)
    return Arrivals(Parts(3, [part])), part


def switches_only(make_build: MakeBuild, period_us: int) -> LiveRecognizer:
    """A recogniser of six switches that answers as long as one of them is read."""
    policy = Policy(max_lost=0.99)
    return LiveRecognizer(make_build(joints=0), switch_period_us=period_us, policy=policy)


def test_what_arrived_is_taken_once_and_in_order() -> None:
    arrivals, part = made()
    assert arrivals.take().arrived == ()
    first, glove, second = SwitchFrame(now_us(), 0b001), GloveFrame(now_us(), b"abc"), SwitchFrame(now_us(), 0b110)
    arrivals.put_switches(part, first, LONGEST_US)
    arrivals.put_glove(glove)
    arrivals.put_switches(part, second, LONGEST_US)
    taken = arrivals.take()
    assert (taken.switches, taken.glove, taken.arrived) == (second, glove, (first, glove, second))
    again = arrivals.take()
    assert (again.switches, again.glove, again.arrived) == (second, glove, ())


def test_waiting_ends_when_something_comes_and_not_before() -> None:
    arrivals, part = made()
    assert not arrivals.wait(0.0)
    bringing = Thread(target=lambda: arrivals.put_switches(part, SwitchFrame(now_us(), 0b1), LONGEST_US))
    bringing.start()
    assert arrivals.wait(10.0)
    bringing.join()
    arrivals.take()
    assert not arrivals.wait(0.0)


def test_of_more_frames_than_are_kept_the_newest_are() -> None:
    arrivals, part = made()
    frames = [GloveFrame(number, b"abc") for number in range(5000)]
    for frame in frames:
        arrivals.put_glove(frame)
    assert arrivals.take().arrived == tuple(frames[-4096:])
    assert arrivals.overflowed == 5000 - 4096
    arrivals.put_switches(part, SwitchFrame(now_us(), 0b1), LONGEST_US)
    assert arrivals.overflowed == 5000 - 4096


def test_parts_that_fall_silent_are_lost_though_nothing_came_and_are_so_once(
    make_build: MakeBuild, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two boards at 1 kHz under a recogniser that waits 20 ms: one falls silent, then the other."""
    first, second, clock, live = Part(0b000111), Part(0b111000), [50_000], switches_only(make_build, 10_000)
    monkeypatch.setattr(thenar.runtime.live.arrivals, "now_us", lambda: clock[0])
    arrivals = Arrivals(Parts(6, [first, second]))

    def step(now: int) -> LiveGrasp:
        clock[0] = now
        taken = arrivals.take()
        assert arrivals.take().arrived == ()
        return live.step(now, 0, taken.switches, None)

    arrivals.put_switches(first, SwitchFrame(50_000, 0b101), 2000)
    arrivals.put_switches(second, SwitchFrame(49_500, 0b011000), 2000)
    whole = step(51_500)
    assert whole.health == "ok"
    degraded = step(51_501)
    assert (degraded.health, degraded.lost, degraded.grasp) == ("degraded", ("s3", "s4", "s5"), whole.grasp)
    for now in (52_001, 53_000, 69_999, 70_001, 80_000):
        gone = step(now)
        assert (gone.health, len(gone.lost), gone.candidate) == ("unknown", 6, "unknown")


def test_a_part_that_falls_silent_later_than_another_one_read_is_lost_at_once(make_build: MakeBuild) -> None:
    """The joined frame is then older than the one before it, but for the time of the part that is lost."""
    fast, slow, live = Part(0b000111), Part(0b111000), switches_only(make_build, 10_000)
    parts = Parts(6, [fast, slow])
    slow.take(SwitchFrame(49_000, 0b011000), 49_000, 20_000)
    fast.take(SwitchFrame(50_000, 0b101), 50_000, 2000)
    assert live.step(52_000, 0, parts.joined(52_000), None).health == "ok"
    assert live.step(52_001, 0, parts.joined(52_001), None).lost == ("s0", "s1", "s2")


def test_a_silent_bus_does_not_take_a_living_glove_down_with_it(make_build: MakeBuild) -> None:
    build = make_build()
    arrivals = Arrivals(Parts(6, [Part(0b111111)]))
    names = ("j0", "j1", "j2")
    recognizer = LiveRecognizer(build, sensor_names=names, switch_period_us=PERIOD_US, glove_period_us=PERIOD_US)
    now = now_us()
    ended_by = GloveFrame(now, b"\x10\x20\x30")
    arrivals.put_glove(ended_by)
    assert recognizer.step(now, 0, SwitchFrame(now, 0b101, glove=ended_by), ended_by).health == "ok"
    for _ in range(5):
        now += PERIOD_US
        arrivals.put_glove(GloveFrame(now, b"\x10\x20\x30"))
        grasp = recognizer.step(now, 0, SwitchFrame(now_us(), 0b101, glove=ended_by), arrivals.take().glove)
    assert grasp.glove_age_us == 0
    assert set(grasp.lost) == {switch.name for switch in build.manifest.switches}


def test_what_is_fresh_is_so_until_two_periods_have_gone_by() -> None:
    slow, fast = Part(0b01), Part(0b10)
    arrivals = Arrivals(Parts(2, [slow, fast]))
    assert arrivals.fresh_for_us(0, 50) is None
    arrivals.put_switches(slow, SwitchFrame(1000, 0), 800)
    assert arrivals.fresh_for_us(1100, 50) == 701
    arrivals.put_switches(fast, SwitchFrame(1050, 0), 200)
    arrivals.put_glove(GloveFrame(1090, b"abc"))
    assert arrivals.fresh_for_us(1100, 50) == 91
    assert arrivals.fresh_for_us(1100, None) == 151
    assert arrivals.fresh_for_us(1250, 50) == 1
    assert arrivals.fresh_for_us(1251, 50) == 550
    assert arrivals.fresh_for_us(1801, 50) is None
