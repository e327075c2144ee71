from collections.abc import Callable
from threading import Thread

from thenar.runtime import Build
from thenar.runtime.live.arrivals import Arrivals
from thenar.runtime.live.frames import GloveFrame, SwitchFrame, now_us
from thenar.runtime.live.joiner import LiveRecognizer
from thenar.runtime.live.parts import Part, Parts

MakeBuild = Callable[..., Build]
PERIOD_US = 10_000_000


def made() -> tuple[Arrivals, Part]:
    part = Part(0b111, PERIOD_US)
    return Arrivals(Parts(3, [part])), part


def test_what_arrived_is_taken_once_and_in_order() -> None:
    arrivals, part = made()
    assert arrivals.take().arrived == ()
    first, glove, second = SwitchFrame(now_us(), 0b001), GloveFrame(now_us(), b"abc"), SwitchFrame(now_us(), 0b110)
    arrivals.put_switches(part, first, PERIOD_US)
    arrivals.put_glove(glove)
    arrivals.put_switches(part, second, PERIOD_US)
    taken = arrivals.take()
    assert (taken.switches, taken.glove, taken.arrived) == (second, glove, (first, glove, second))
    again = arrivals.take()
    assert (again.switches, again.glove, again.arrived) == (second, glove, ())


def test_waiting_ends_when_something_comes_and_not_before() -> None:
    arrivals, part = made()
    assert not arrivals.wait(0.0)
    bringing = Thread(target=lambda: arrivals.put_switches(part, SwitchFrame(now_us(), 0b1), PERIOD_US))
    bringing.start()
    assert arrivals.wait(10.0)
    bringing.join()
    arrivals.take()
    assert not arrivals.wait(0.0)


def test_of_more_frames_than_are_kept_the_newest_are() -> None:
    arrivals, _ = made()
    frames = [GloveFrame(number, b"abc") for number in range(5000)]
    for frame in frames:
        arrivals.put_glove(frame)
    assert arrivals.take().arrived == tuple(frames[-4096:])


def test_a_part_that_fell_silent_is_lost_though_nothing_came_and_is_so_once() -> None:
    speaking, silent = Part(0b01, PERIOD_US), Part(0b10, 0)
    arrivals, now = Arrivals(Parts(2, [speaking, silent])), now_us()
    arrivals.put_switches(silent, SwitchFrame(now, 0b10), PERIOD_US)
    arrivals.put_switches(speaking, SwitchFrame(now, 0b01), PERIOD_US)
    assert arrivals.take().switches == SwitchFrame(now, 0b11)
    silent.period_us = -1  # as if two of its periods had gone by
    lost = SwitchFrame(now, 0b01, lost=0b10)
    taken = arrivals.take()
    assert (taken.switches, taken.arrived) == (lost, (lost,))
    assert (arrivals.take().switches, arrivals.take().arrived) == (lost, ())


def test_a_silent_bus_does_not_take_a_living_glove_down_with_it(make_build: MakeBuild) -> None:
    build = make_build()
    arrivals = Arrivals(Parts(6, [Part(0b111111, PERIOD_US)]))
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
    slow, fast = Part(0b01, 400), Part(0b10, 100)
    arrivals = Arrivals(Parts(2, [slow, fast]))
    assert arrivals.fresh_for_us(0, 50) is None
    arrivals.put_switches(slow, SwitchFrame(1000, 0), 400)
    assert arrivals.fresh_for_us(1100, 50) == 701
    arrivals.put_switches(fast, SwitchFrame(1050, 0), 100)
    arrivals.put_glove(GloveFrame(1090, b"abc"))
    assert arrivals.fresh_for_us(1100, 50) == 91
    assert arrivals.fresh_for_us(1100, None) == 151
    assert arrivals.fresh_for_us(1250, 50) == 1
    assert arrivals.fresh_for_us(1251, 50) == 550
    assert arrivals.fresh_for_us(1801, 50) is None
