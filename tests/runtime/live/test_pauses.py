from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.pauses import Pauses

MASKS = st.integers(0, 255)


def test_a_switch_that_was_not_read_for_longer_than_the_pause_is_told_once_when_it_is_read_again() -> None:
    pauses = Pauses(100)
    readings = [(0, 0b11), (10, 0b01), (50, 0b01), (111, 0b11), (112, 0b11), (120, 0b01), (220, 0b11)]
    assert [pauses.over(time, known) for time, known in readings] == [0, 0, 0, 0b10, 0, 0, 0]


@given(st.lists(st.tuples(st.integers(0, 200), MASKS), max_size=40), st.integers(0, 300))
def test_it_is_so_for_every_switch_by_itself(steps: list[tuple[int, int]], pause_us: int) -> None:
    pauses, now = Pauses(pause_us), 0
    gone = dict[int, int]()
    before = 0
    for passed, known in steps:
        now += passed
        gone |= {switch: now for switch in range(8) if (before & ~known) >> switch & 1}
        back = [switch for switch in gone if known >> switch & 1]
        assert pauses.over(now, known) == sum(1 << one for one in back if now - gone[one] > pause_us)
        for one in back:
            del gone[one]
        before = known
