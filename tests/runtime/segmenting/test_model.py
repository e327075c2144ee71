"""The costs of segments: what is refused, what frames cost, and that paths differ by no more than is proved."""

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.errors import BuildError
from thenar.runtime.segmenting.decoder import _NEVER, Decoder, frame_costs
from thenar.runtime.segmenting.model import LARGEST, SegmentModel, gain_of

_USUAL = SegmentModel.usual(3, True, 100.0)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"enter": (1, 2)}, "enters 2 types, and leaves 3"),
        ({"least": (1, 2, 3)}, "durations are of 2 types"),
        ({"enter": (), "leave": (), "direct": (), "least": (1,), "stay": (0,)}, "enters 0 types"),
        ({"stay": (0, -1, 0, 0)}, "a cost below 0"),
        ({"least": (0, 1, 1, 1)}, "not 1 to 255 ticks"),
        ({"shift": 9}, "a frame cannot cost"),
        ({"shift": 3, "gain": 20}, "takes a byte to 19, below 48"),
        ({"least": (200, 1, 1, 1), "stay": (0, 99, 0, 0)}, "paths through this segment model may differ by 5"),
    ],
)
def test_costs_that_do_not_fit_are_refused(changed: dict[str, object], reason: str) -> None:
    with pytest.raises(BuildError, match=reason):
        msgspec.structs.replace(_USUAL, **changed)


@given(st.floats(0.05, 30000), st.floats(0.02, 2))
def test_gains_are_as_near_as_bytes_allow(scale: float, temperature: float) -> None:
    shift, gain = gain_of(scale, temperature)
    factor = 16 * temperature / scale
    assert 0 <= shift <= 8
    assert 1 <= gain <= 65535
    if shift in range(1, 8):
        assert 128 <= gain <= 255
    if 2.0**-8 <= factor <= 255:
        assert math.isclose(gain / 2 ** (8 + shift), factor, rel_tol=1 / 250)
    assert SegmentModel.usual(5, True, scale).spread <= LARGEST


@given(
    st.integers(0, 8),
    st.integers(1, 65535),
    st.integers(1, 254),
    st.none() | st.integers(0, 99),
    st.lists(st.tuples(st.lists(st.integers(-32767, 32767), min_size=4, max_size=4), st.booleans()), max_size=5),
)
def test_frames_cost_what_the_text_says(
    shift: int, gain: int, most: int, refusal: int | None, frames: list[tuple[list[int], bool]]
) -> None:
    most = most if shift == 8 else min(most, max(255 * gain >> 8, 1))
    gain = max(gain, 2)
    one = (1,) * 4
    model = SegmentModel(
        shift=shift, gain=gain, most=most, least=one, stay=one, enter=one[1:], leave=one[1:], direct=one[1:],
        refusal=refusal,
    )  # fmt: skip
    for lanes, said in frames:
        row, no = lanes[: model.n_lanes], said and refusal is not None
        by_hand = [min(((max(row) - lane) >> shift) * gain // 256, most) for lane in row]
        if refusal is not None:
            by_hand = [cost + refusal * no for cost in by_hand] + [0 if no else refusal]
        assert frame_costs(model, row, no) == by_hand


@given(st.data())
def test_whatever_the_decoder_compares_differs_by_no_more_than_is_proved(data: st.DataObject) -> None:
    n_types = data.draw(st.integers(1, 3))
    few = st.integers(0, 30)
    held = [tuple(data.draw(st.lists(few, min_size=n_types, max_size=n_types))) for _ in range(4)]
    least = tuple(data.draw(st.lists(st.integers(1, 5), min_size=n_types + 1, max_size=n_types + 1)))
    model = SegmentModel(
        shift=0, gain=256, most=9, least=least, stay=(*held[0], 3), enter=held[1], leave=held[2], direct=held[3]
    )
    paths, change = Decoder(model, 5), max(*held[1], *held[2], *held[3])
    rows = data.draw(st.lists(st.lists(st.sampled_from([0, 9]), min_size=n_types + 1, max_size=n_types + 1)))
    for row in rows * 3:
        paths._step(row)
        now = [best + total for best, total in zip(paths._best, paths._sums, strict=True)]
        left = [cost for cost in paths._costs[:2] if cost < _NEVER]
        assert max(*now, *left) + change - min(now) <= model.spread
