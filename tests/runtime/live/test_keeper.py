from collections.abc import Iterator
from queue import Queue
from threading import Event

import pytest

from thenar.drivers.errors import DeviceError, SettingError
from thenar.runtime.live.keeper import RETRY_S, Keeper

LONG_S = 10.0


class Device:
    """Hands out what the test puts in, one thing a reading; an exception is raised."""

    def __init__(self) -> None:
        self.samples: Queue[int | Exception] = Queue()
        self.openings: Queue[Exception | None] = Queue()
        self.closed = Event()

    def open(self) -> None:
        wrong = self.openings.get(timeout=LONG_S)
        if wrong is not None:
            raise wrong

    def read(self, timeout_s: float) -> int | None:
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
        self.taken: Queue[int] = Queue()
        self.changes: Queue[tuple[bool, str]] = Queue()
        self.keeper = Keeper("thing", self.device, self.taken.put, self._changed)
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
        kept.device.samples.put(number)
    assert [kept.taken.get(timeout=LONG_S) for _ in range(100)] == list(range(100))
    assert kept.next_change() == (True, "")


def test_a_device_that_is_lost_is_closed_and_opened_again_and_both_are_told(kept: Kept) -> None:
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    kept.device.samples.put(DeviceError("the cable is out"))
    assert kept.next_change() == (False, "the cable is out")
    assert kept.device.closed.wait(LONG_S)
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    kept.device.samples.put(7)
    assert kept.taken.get(timeout=LONG_S) == 7
    assert kept.keeper.state.opened == 2


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


def test_what_a_device_could_do_before_is_tried_again(kept: Kept) -> None:
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    kept.device.samples.put(SettingError("an answer that the cable garbled"))
    assert kept.next_change() == (False, "an answer that the cable garbled")
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    assert kept.keeper.failure is None


def test_a_fault_of_the_program_shows_and_leaves_no_dead_thread(kept: Kept) -> None:
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")
    kept.device.samples.put(ZeroDivisionError("oops"))
    assert kept.next_change() == (False, "ZeroDivisionError: oops")
    kept.device.openings.put(None)
    assert kept.next_change() == (True, "")


def test_retries_leave_time_to_recover_within_a_second() -> None:
    assert RETRY_S <= 0.25
