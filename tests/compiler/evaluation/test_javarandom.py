"""Numbers below marked as Java's were printed by java.util.Random; they also stand in many published examples."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.evaluation.javarandom import JavaRandom

seeds = st.integers(-(2**63), 2**63 - 1)


def test_seed_42_gives_the_well_known_first_numbers() -> None:
    random = JavaRandom(42)
    assert [random.next_int(10) for _ in range(10)] == [0, 3, 8, 4, 0, 5, 5, 8, 9, 3]


def test_the_first_32_bits_of_seed_0_are_javas() -> None:
    # new Random(0).nextInt() is -1155484576.
    assert JavaRandom(0).next_bits(32) - (1 << 32) == -1155484576


@given(seeds, st.integers(1, 2**31 - 1))
def test_every_number_is_below_its_bound(seed: int, bound: int) -> None:
    assert 0 <= JavaRandom(seed).next_int(bound) < bound


@given(seeds, st.integers(0, 30))
def test_a_power_of_two_takes_the_high_bits(seed: int, exponent: int) -> None:
    assert JavaRandom(seed).next_int(1 << exponent) == JavaRandom(seed).next_bits(31) >> (31 - exponent)


@given(seeds, st.integers(0, 50))
def test_a_shuffle_keeps_every_item_and_is_repeatable(seed: int, size: int) -> None:
    first, second = list(range(size)), list(range(size))
    JavaRandom(seed).shuffle(first)
    JavaRandom(seed).shuffle(second)
    assert first == second
    assert sorted(first) == list(range(size))


def test_a_draw_from_the_incomplete_last_run_is_thrown_away() -> None:
    # With this bound nearly half of all draws fall into the incomplete run; the accepted ones are the draws themselves.
    bound = (1 << 30) + 1
    random, raw = JavaRandom(7), JavaRandom(7)
    drawn = [random.next_int(bound) for _ in range(50)]
    accepted = [number for number in (raw.next_bits(31) for _ in range(400)) if number < bound]
    assert drawn == accepted[:50]


@pytest.mark.parametrize("bound", [0, -1, 2**31])
def test_a_bound_that_java_refuses_is_refused(bound: int) -> None:
    with pytest.raises(ValueError, match="bound"):
        JavaRandom(1).next_int(bound)
