import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.effects.wire_damaged_bytes import damaged


@given(st.binary(min_size=1, max_size=50), st.integers(0, 2**32), st.floats(1e-9, 0.999))
def test_one_bit_turns_where_the_number_is_below_the_rate(data: bytes, seed: int, rate: float) -> None:
    sent = np.frombuffer(data, dtype=np.uint8)
    chances = np.random.default_rng(seed).random(len(sent)) * min(1.0, 2.0 * rate)
    turned = np.bitwise_count(damaged(sent, chances, rate) ^ sent)
    assert turned.tolist() == (chances < rate).astype(int).tolist()


def test_every_bit_turns_as_often() -> None:
    chances = (np.arange(8000) + 0.5) / 8000 * 0.01
    turned = damaged(np.zeros(8000, dtype=np.uint8), chances, 0.01)
    values, counts = np.unique(turned, return_counts=True)
    assert values.tolist() == [1, 2, 4, 8, 16, 32, 64, 128]
    assert counts.tolist() == [1000] * 8
