from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.rewiring import Rewired

PAIRS = st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), unique_by=(lambda p: p[0], lambda p: p[1]))


@given(PAIRS, st.lists(st.integers(0, 2**41 - 1)))
def test_every_bit_goes_to_its_switch_whatever_was_asked_before(
    pairs: list[tuple[int, int]], states: list[int]
) -> None:
    rewired = Rewired(pairs)
    for bits in states:
        closed = {switch for bit, switch in pairs if bits >> bit & 1}
        assert rewired(bits) == sum(1 << switch for switch in closed)


@given(PAIRS)
def test_the_targets_are_all_its_switches(pairs: list[tuple[int, int]]) -> None:
    assert Rewired(pairs).targets == Rewired(pairs)(2**41 - 1)
