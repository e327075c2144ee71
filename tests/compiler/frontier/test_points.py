from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.frontier.points import STEP, FrontierError, front, frontier_from_bytes, frontier_to_bytes

Pair = tuple[int, int]
PAIRS = st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), max_size=12)


@pytest.mark.parametrize("name", ["\x1b]0;owned\x07", "two\nlines", "a\u202eb", "?", "x" * 201])
def test_a_frontier_whose_names_would_deceive_is_refused(examples: Any, name: str) -> None:
    made = examples.example_frontier()
    point = msgspec.structs.replace(made.points[0], switches=(name,))
    for changed in ({"grasps": (name, *made.grasps)}, {"points": (point, *made.points[1:])}):
        with pytest.raises(FrontierError, match=r"holds a control|at most 200|missing value") as refused:
            frontier_from_bytes(frontier_to_bytes(msgspec.structs.replace(made, **changed)))
        assert str(refused.value).isprintable()


def _price(pair: Pair) -> float:
    return float(pair[0])


def _worth(pair: Pair) -> float:
    return float(pair[1])


@given(PAIRS)
def test_the_front_is_what_no_other_beats(pairs: list[Pair]) -> None:
    best = {
        (price, worth)
        for price, worth in pairs
        if not any((p <= price and w > worth) or (p < price and w >= worth) for p, w in pairs)
    }
    found = front(pairs, _price, _worth)
    assert set(found) == best
    assert found == sorted(best)


def test_less_than_a_step_is_no_better() -> None:
    rates = [(1, 0.9), (2, 0.9 + STEP / 2), (3, 0.9 + 2 * STEP)]
    assert front(rates, lambda one: one[0], lambda one: one[1]) == [rates[0], rates[2]]
