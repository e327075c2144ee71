from collections.abc import Callable

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.effects.wire_damaged_bytes import Parameters, damaged, prepare
from thenar.simulator.pipeline.batch import Batch, Traffic
from thenar.simulator.pipeline.effect import Setting

MakeBatch = Callable[..., Batch]


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


def test_one_number_a_byte_whatever_else_happens_to_the_frame_that_is_read(
    make_batch: MakeBatch, make_draw: Callable, make_setting: Callable
) -> None:
    def arriving(setting: Setting, frames: int, rows: range) -> np.ndarray:
        batch = make_batch(rows)
        zeros = np.zeros((len(batch), frames, 46), dtype=np.uint8)
        batch.traffic = Traffic(zeros, zeros.astype(np.int64), np.ones(zeros.shape, dtype=np.bool_), 26)
        prepare(Parameters(rate=0.3), setting)(batch, make_draw("wire.damaged_bytes", batch))
        assert not zeros.any()
        return batch.traffic.data

    alone, many = arriving(make_setting(), 1, range(4, 5)), arriving(make_setting(timed=True), 33, range(6))
    assert np.array_equal(many[4, 28], alone[0, 0])
    assert 0.2 < (many != 0).mean() < 0.4
