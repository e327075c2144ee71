"""Frames that age, and sets of switches."""

from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.frames import BitRemap, Newest, SwitchFrame

PAIRS = st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), unique_by=(lambda p: p[0], lambda p: p[1]))


@given(ahead=st.integers(0, 10**12), again=st.integers(0, 5))
def test_a_frame_from_the_future_ages_from_when_it_came(ahead: int, again: int) -> None:
    newest = Newest[SwitchFrame]()
    for late in range(again + 1):
        newest.take(SwitchFrame(1000 + ahead, 5), 1000 + 30 * late, 200)
    assert newest.expires_us == 1200


def test_an_older_frame_does_not_replace_a_newer_one() -> None:
    newest = Newest[SwitchFrame]()
    for frame in (SwitchFrame(50, 1), SwitchFrame(49, 2), SwitchFrame(50, 3)):
        newest.take(frame, 60, 200)
    assert newest.frame == SwitchFrame(50, 3)


@given(PAIRS, st.lists(st.integers(0, 2**41 - 1)))
def test_every_bit_goes_to_its_switch_whatever_was_asked_before(
    pairs: list[tuple[int, int]], states: list[int]
) -> None:
    rewired = BitRemap(pairs)
    for bits in states:
        closed = {switch for bit, switch in pairs if bits >> bit & 1}
        assert rewired(bits) == sum(1 << switch for switch in closed)


@given(PAIRS)
def test_the_targets_are_all_its_switches(pairs: list[tuple[int, int]]) -> None:
    assert BitRemap(pairs).targets == BitRemap(pairs)(2**41 - 1)
