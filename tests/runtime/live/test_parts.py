from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.parts import Part, Parts

PERIOD_US = 10_000
LOW, HIGH, NOBODYS = 0b0011, 0b1100, 0b10000


def parts() -> Parts:
    return Parts(5, [Part(LOW, PERIOD_US), Part(HIGH, PERIOD_US)])


def test_nothing_is_joined_before_the_first_frame() -> None:
    assert parts().joined(0) is None


def test_a_part_alone_that_owns_everything_is_handed_on_as_it_is() -> None:
    alone = Parts(2, [Part(LOW, PERIOD_US)])
    frame = alone.parts[0].newest = SwitchFrame(5, 0b01, 0, 0b10, GloveFrame(3, b"x"))
    assert alone.joined(6) is frame


def test_parts_are_joined_at_the_time_of_the_newest() -> None:
    both = parts()
    both.parts[0].newest, both.parts[1].newest = SwitchFrame(100, 0b0001), SwitchFrame(90, 0b1000, lost=0b0100)
    assert both.joined(200) == SwitchFrame(100, 0b1001, lost=0b0100 | NOBODYS)


@given(st.integers(0, 4 * PERIOD_US))
def test_what_a_part_owns_is_lost_once_it_is_silent_for_two_periods(silence_us: int) -> None:
    both = parts()
    both.parts[0].newest, both.parts[1].newest = SwitchFrame(silence_us, 0b0001), SwitchFrame(0, 0b1000)
    joined = both.joined(silence_us)
    assert joined is not None
    silent = silence_us > 2 * PERIOD_US
    assert joined.lost == NOBODYS | HIGH * silent
    assert joined.closed == 0b0001 | 0b1000 * (not silent)


def test_when_all_are_silent_the_newest_keeps_its_old_time() -> None:
    both = parts()
    both.parts[0].newest, both.parts[1].newest = SwitchFrame(7, 0b0001), SwitchFrame(9, 0b1000)
    joined = both.joined(10 * PERIOD_US)
    assert joined is not None
    assert joined.time_us == 9


def test_a_part_that_has_not_come_yet_is_lost() -> None:
    both = parts()
    both.parts[1].newest = SwitchFrame(9, 0b1000)
    assert both.joined(10) == SwitchFrame(9, 0b1000, lost=LOW | NOBODYS)
