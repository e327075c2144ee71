from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.health import Tally

masks = st.lists(st.integers(0, (1 << 70) - 1) | st.sampled_from([1, 3, (1 << 70) - 1]), max_size=70)


@given(first=masks, second=masks)
def test_every_bit_is_counted_by_itself_and_anew_after_each_end(first: list[int], second: list[int]) -> None:
    tally = Tally(70)
    for counted in (first, second):
        for mask in counted:
            tally.add(mask)
        assert tally.end() == [sum(mask >> bit & 1 for mask in counted) for bit in range(70)]
