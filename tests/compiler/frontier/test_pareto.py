from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.frontier.pareto import STEP, front

Pair = tuple[int, int]
PAIRS = st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), max_size=12)


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
