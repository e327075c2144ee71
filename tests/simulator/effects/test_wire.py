"""Bytes on the wire get lost or damaged."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.effects.wire_damaged_bytes import damaged
from thenar.simulator.effects.wire_lost_bytes import arrives, prepare
from thenar.simulator.pipeline.batch import SerialTraffic
from thenar.simulator.pipeline.effect import SceneSetting

from ..small import make_batch, make_draw, make_setting


def through(setting: SceneSetting, shape: tuple[int, int], rows: range, rate: float = 0.2) -> np.ndarray:
    batch = make_batch(rows)
    zeros = np.zeros((len(batch), *shape), dtype=np.uint8)
    batch.traffic = SerialTraffic(zeros, zeros.astype(np.int64), np.ones(zeros.shape, dtype=np.bool_), 26)
    before = batch.traffic
    prepare(setting, rate=rate)(batch, make_draw("wire.lost_bytes", batch))
    assert batch.traffic.data is before.data
    assert before.arrives.all()
    return batch.traffic.arrives


def test_a_byte_is_lost_where_its_number_is_below_the_rate() -> None:
    chances = np.array([0.001, 0.0099, 0.01, 0.5])
    assert arrives(chances, 0.01).tolist() == [False, False, True, True]


def test_the_share_that_is_lost_is_the_rate() -> None:
    came = through(make_setting(), (1, 46), range(500), rate=0.2)
    assert abs(1.0 - came.mean() - 0.2) < 0.01


def test_what_was_lost_before_stays_lost() -> None:
    batch = make_batch(range(2))
    data = np.zeros((2, 1, 46), dtype=np.uint8)
    batch.traffic = SerialTraffic(data, data.astype(np.int64), np.zeros(data.shape, dtype=np.bool_), 26)
    prepare(make_setting())(batch, make_draw("wire.lost_bytes", batch))
    assert not batch.traffic.arrives.any()


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
