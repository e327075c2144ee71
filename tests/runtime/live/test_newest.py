from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.frames import SwitchFrame
from thenar.runtime.live.newest import Newest


def test_a_frame_counts_for_two_periods_and_no_longer() -> None:
    newest = Newest[SwitchFrame](100)
    assert newest.fresh(0) is None
    newest.take(SwitchFrame(1000, 5), 1000)
    assert newest.fresh(1200) == SwitchFrame(1000, 5)
    assert newest.fresh(1201) is None
    assert newest.time_us == 1000


@given(ahead=st.integers(0, 10**12), again=st.integers(0, 5))
def test_a_frame_from_the_future_ages_from_when_it_came(ahead: int, again: int) -> None:
    newest = Newest[SwitchFrame](100)
    for late in range(again + 1):
        newest.take(SwitchFrame(1000 + ahead, 5), 1000 + 30 * late)
    assert newest.fresh(1200) is not None
    assert newest.fresh(1201) is None


def test_an_older_frame_does_not_replace_a_newer_one() -> None:
    newest = Newest[SwitchFrame](100)
    for frame in (SwitchFrame(50, 1), SwitchFrame(49, 2), SwitchFrame(50, 3)):
        newest.take(frame, 60)
    assert newest.fresh(60) == SwitchFrame(50, 3)


def test_a_device_that_is_not_there_has_no_frames() -> None:
    newest = Newest[SwitchFrame](None)
    newest.take(SwitchFrame(1, 1), 1)
    assert newest.fresh(1) is None
    assert newest.time_us is None
