from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.lines import checked
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import Effect, SceneSetting, Step
from thenar.simulator.pipeline.wire import RECEIVE, SEND

from ..small import make_batch, make_draw, make_setting

# $row, five digits, ten digits, a digit for every four of 160 switches, a checksum, and CR LF.
FRAMES, ROW_BYTES, RECORD_BYTES = 5, 5 + 6 + 11 + 40 + 3 + 2, 20


def prepared(effect: Effect, setting: SceneSetting) -> Step:
    assert effect.prepare is not None
    return effect.prepare(setting)


def make_sent(frame_us: np.ndarray, delay_us: np.ndarray | None = None, switches: int = 160) -> Batch:
    """Return a batch of random frames of these times, sent."""
    batch, random = make_batch(range(len(frame_us))), np.random.default_rng(3)
    batch.frame_us, batch.delay_us = frame_us, delay_us
    batch.bits = random.random((*frame_us.shape, switches)) < 0.1
    batch.raw = random.integers(1, 256, (*frame_us.shape, 18)).astype(np.uint8)
    batch.settled = np.ones(len(batch), dtype=np.bool_)
    prepared(SEND, make_setting(timed=True))(batch, make_draw("glove.send", batch))
    return batch


def receive(batch: Batch) -> None:
    prepared(RECEIVE, make_setting(timed=True))(batch, make_draw("glove.receive", batch))


def every_10_ms(repetitions: int = 2) -> np.ndarray:
    return np.tile(10_000 * np.arange(FRAMES), (repetitions, 1))


def lose(batch: Batch, *places: tuple[int, int, int]) -> None:
    arrives = batch.traffic.arrives.copy()
    for place in places:
        arrives[place] = False
    batch.traffic = replace(batch.traffic, arrives=arrives)


@pytest.mark.parametrize("switches", [160, 8, 9, 33])
def test_an_undisturbed_line_changes_nothing(switches: int) -> None:
    batch = make_sent(every_10_ms(), switches=switches)
    bits, raw = batch.bits, batch.raw
    receive(batch)
    assert np.array_equal(batch.bits, bits)
    assert np.array_equal(batch.raw, raw)
    assert batch.lost is not None
    assert not batch.lost.any()
    assert batch.settled.all()


def test_more_than_256_frames_still_match() -> None:
    batch = make_sent(np.tile(10_000 * np.arange(300), (1, 1)))
    bits = batch.bits
    receive(batch)
    assert np.array_equal(batch.bits, bits)


def test_bytes_take_ten_bits_after_scan_and_glove() -> None:
    batch = make_sent(every_10_ms(1), delay_us=np.full(160, 1500))
    at_us = batch.traffic.at_us[0]
    assert at_us.shape == (FRAMES, ROW_BYTES + RECORD_BYTES)
    assert at_us[2, 0] == 20_000 + 1500 + 10
    assert at_us[2, ROW_BYTES - 1] == 20_000 + 1500 + 670
    # 18 sensors, a quarter of a millisecond each, and 20 bytes.
    assert at_us[2, -1] == 20_000 + 4500 + 1737


def test_a_frame_waits_until_the_line_is_free() -> None:
    batch = make_sent(np.array([[0, 100, 200, 50_000, 50_001]]))
    at_us = batch.traffic.at_us[0, :, :ROW_BYTES]
    assert at_us[:, -1].tolist() == [670, 2 * 670, 3 * 670, 50_670, 50_670 + 670]
    assert (np.diff(at_us.ravel()) >= 10).all()


def test_what_is_lost_leaves_the_frame_before_in_place() -> None:
    batch = make_sent(every_10_ms())
    bits, raw = batch.bits, batch.raw
    lose(batch, (0, 2, 5), (1, 3, ROW_BYTES + 4))
    receive(batch)
    assert batch.lost is not None
    assert np.argwhere(batch.lost).tolist() == [[0, 2], [1, 3]]
    expected = bits.copy()
    expected[0, 2] = bits[0, 1]
    assert np.array_equal(batch.bits, expected)
    records = raw.copy()
    records[1, 3] = raw[1, 2]
    assert np.array_equal(batch.raw, records)
    assert batch.settled.all()


@pytest.mark.parametrize("lost", [1, 2])
def test_an_end_of_two_bytes_keeps_rows_apart_if_one_is_lost(lost: int) -> None:
    batch = make_sent(every_10_ms())
    bits = batch.bits
    lose(batch, *((0, 1, ROW_BYTES - byte) for byte in range(1, lost + 1)))
    receive(batch)
    assert batch.lost is not None
    assert np.argwhere(batch.lost).tolist() == [[0, 1], [0, 2]][: 2 * (lost - 1)]
    assert np.array_equal(batch.bits[0, 1:3], bits[0, [0, 0] if lost == 2 else [1, 2]])


@pytest.mark.parametrize(
    "other", [checked(("rows", "1", *["0" * 27, "0" * 26])), checked(("row", "00003", "0000000000", "0" * 38, "5"))]
)
def test_only_rows_of_all_switches_are_taken_for_such(other: bytes) -> None:
    batch = make_sent(every_10_ms(1))
    bits = batch.bits
    data = batch.traffic.data.copy()
    data[0, 3, :ROW_BYTES] = np.frombuffer(other, dtype=np.uint8)
    batch.traffic = replace(batch.traffic, data=data)
    receive(batch)
    assert batch.lost is not None
    assert np.flatnonzero(batch.lost[0]).tolist() == [3]
    assert np.array_equal(batch.bits[0, 3], bits[0, 2])


def test_a_record_in_which_the_glove_complains_is_not_taken() -> None:
    """Of record 1 the end is lost, and of record 2 all but its last two sensors, which read 'es', and its end."""
    batch = make_sent(every_10_ms(1))
    raw = batch.raw
    data = batch.traffic.data.copy()
    data[0, 2, -3:-1] = list(b"es")
    batch.traffic = replace(batch.traffic, data=data)
    lose(batch, (0, 1, -1), *((0, 2, place) for place in range(ROW_BYTES, ROW_BYTES + RECORD_BYTES - 3)))
    receive(batch)
    assert batch.lost is not None
    assert np.flatnonzero(batch.lost[0]).tolist() == [1, 2]
    assert np.array_equal(batch.raw[0, 2], raw[0, 0])


def test_before_the_first_frame_nothing_touches() -> None:
    batch = make_sent(every_10_ms(1))
    raw = batch.raw
    lose(batch, (0, 0, 3), (0, 0, ROW_BYTES + 3), (0, 1, ROW_BYTES + 3))
    receive(batch)
    assert not batch.bits[0, 0].any()
    assert np.array_equal(batch.raw[0, :3], raw[0, [2, 2, 2]])
    assert batch.settled.all()


@pytest.mark.parametrize("line", [slice(0, ROW_BYTES), slice(ROW_BYTES, None)])
def test_a_repetition_to_which_a_line_brings_nothing_is_not_settled(line: slice) -> None:
    batch = make_sent(every_10_ms(3))
    arrives = batch.traffic.arrives.copy()
    arrives[1, :, line] = False
    batch.traffic = replace(batch.traffic, arrives=arrives)
    receive(batch)
    assert batch.settled.tolist() == [True, False, True]
    assert batch.lost is not None
    assert batch.lost.tolist() == [[False] * FRAMES, [True] * FRAMES, [False] * FRAMES]


@given(st.integers(0, 2**32))
def test_arriving_frames_were_sent_and_never_later(seed: int) -> None:
    """Lost bytes that the checksum does not show are of the number or the clock: the switches have all digits."""
    batch, random = make_sent(every_10_ms()), np.random.default_rng(seed)
    bits = batch.bits
    batch.traffic = replace(batch.traffic, arrives=random.random(batch.traffic.data.shape) > random.random() / 20)
    receive(batch)
    for repetition in range(len(bits)):
        for frame in range(FRAMES):
            sent = [np.zeros(160, bool), *bits[repetition, : frame + 1]]
            assert any(np.array_equal(batch.bits[repetition, frame], one) for one in sent)


def test_bytes_are_counted() -> None:
    batch = make_sent(every_10_ms(3))
    draw = make_draw("glove.send", batch)
    prepared(SEND, make_setting(timed=True))(batch, draw)
    assert draw.draws == {"bytes sent": 3 * FRAMES * (ROW_BYTES + RECORD_BYTES)}


def test_frames_faster_than_the_line_are_refused() -> None:
    with pytest.raises(SceneError, match=r"recording.rate_hz: 500 frames .* at most 160"):
        prepared(SEND, make_setting(timed=True, period_us=2000))
    prepared(SEND, make_setting(timed=True, period_us=6237))
