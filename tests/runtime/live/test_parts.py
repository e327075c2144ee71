from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.parts import Part, Parts

LONGEST_US = 20_000
LOW, HIGH, NOBODYS = 0b0011, 0b1100, 0b10000

times, limits = st.integers(0, 100), st.integers(0, 100)


def parts(*frames: SwitchFrame, longest_us: tuple[int, int] = (LONGEST_US, LONGEST_US)) -> Parts:
    """Two parts, the first ones with a frame that came in as soon as it was read."""
    found = Parts(5, [Part(LOW), Part(HIGH)])
    for part, frame, longest in zip(found.parts, frames, longest_us, strict=False):
        part.take(frame, frame.time_us, longest)
    return found


def test_nothing_is_joined_before_the_first_frame() -> None:
    assert parts().joined(0) is None


def test_a_part_alone_that_owns_everything_is_handed_on_as_it_is() -> None:
    alone, frame = Parts(2, [Part(LOW)]), SwitchFrame(5, 0b01, 0, 0b10, GloveFrame(3, b"x"))
    alone.parts[0].take(frame, 6, LONGEST_US)
    assert alone.joined(6) is frame


def test_parts_are_joined_at_the_time_of_the_newest() -> None:
    both = parts(SwitchFrame(100, 0b0001), SwitchFrame(90, 0b1000, lost=0b0100))
    assert both.joined(200) == SwitchFrame(100, 0b1001, lost=0b0100 | NOBODYS)


@given(st.tuples(times, times), st.tuples(limits, limits), times)
def test_what_a_part_owns_is_lost_as_soon_as_its_frame_has_expired(
    read_us: tuple[int, int], longest_us: tuple[int, int], later_us: int
) -> None:
    """All of it when all have; and the time never falls, or whoever takes the frames would keep the one before."""
    both = parts(SwitchFrame(read_us[0], 0b0001), SwitchFrame(read_us[1], 0b1000), longest_us=longest_us)
    now = max(read_us) + later_us
    low, high = (now - read <= longest for read, longest in zip(read_us, longest_us, strict=True))
    lost = NOBODYS | LOW * (not low) | HIGH * (not high)
    assert both.joined(now) == SwitchFrame(max(read_us), 0b0001 * low | 0b1000 * high, lost)


def test_a_frame_from_the_future_expires_as_if_it_were_of_the_moment_at_which_it_came() -> None:
    alone = Parts(2, [Part(LOW)])
    alone.parts[0].take(SwitchFrame(10**9, 0b01), 100, LONGEST_US)
    for now, lost in ((100 + LONGEST_US, 0), (101 + LONGEST_US, LOW)):
        joined = alone.joined(now)
        assert joined is not None
        assert joined.lost == lost


def test_a_part_that_has_not_come_yet_is_lost() -> None:
    both = Parts(5, [Part(LOW), Part(HIGH)])
    both.parts[1].take(SwitchFrame(9, 0b1000), 9, LONGEST_US)
    assert both.joined(10) == SwitchFrame(9, 0b1000, lost=LOW | NOBODYS)
