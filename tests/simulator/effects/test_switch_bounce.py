from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.effects.switch_bounce import prepare
from thenar.simulator.pipeline.ramp import NEVER

from ..small import make_batch, make_draw, make_setting

if TYPE_CHECKING:
    from thenar.simulator.pipeline.batch import Batch

ON_US, OFF_US = 20_000, 100_000


def bounced(
    read_us: np.ndarray, parameters: dict[str, float] | None = None, first: int = 0, delay_us: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the bits read at these times (n, F), without and with bouncing."""
    n = len(read_us)
    batch: Batch = make_batch(range(first, first + n))
    batch.frame_us, batch.delay_us = read_us, delay_us
    # Of four switches one closes and opens, one only closes, one never closes, one closes as time begins.
    batch.on_us = np.tile([ON_US, ON_US, NEVER, 0], (n, 1))
    batch.off_us = np.tile([OFF_US, NEVER, NEVER, NEVER], (n, 1))
    at = read_us[:, :, None] + (0 if delay_us is None else delay_us)
    batch.bits = rest = (batch.on_us[:, None] <= at) & (at < batch.off_us[:, None])
    prepare(make_setting(timed=True), **(parameters or {}))(batch, make_draw("switch.bounce", batch))
    return rest, batch.bits


def finely(first_us: int, last_us: int, n: int = 40) -> np.ndarray:
    return np.tile(np.arange(first_us, last_us, 10), (n, 1))


@given(st.lists(st.integers(-50_000, 150_000), min_size=1, max_size=20), st.integers(0, 1000))
def test_no_bounce_outlasts_its_limit_or_comes_before_its_edge(times: list[int], first: int) -> None:
    at = np.sort(np.array([times]), axis=1)
    rest, bits = bounced(at, first=first)
    for switch, edges in enumerate([[(ON_US, 3000), (OFF_US, 8000)], [(ON_US, 3000)], [], [(0, 3000)]]):
        chatters = np.zeros(at.shape, dtype=np.bool_)
        for edge, longest in edges:
            chatters |= (at >= edge) & (at < edge + longest)
        assert np.array_equal(bits[..., switch][~chatters], rest[..., switch][~chatters])


def test_a_contact_chatters_two_to_ten_times_and_then_rests() -> None:
    for first, last, switch in ((ON_US, ON_US + 3000, 0), (OFF_US, OFF_US + 8000, 0)):
        rest, bits = bounced(finely(first - 100, last + 100))
        # Edges that fall between two readings come in pairs; the contact's own first edge is not counted.
        edges = np.count_nonzero(np.diff(bits[..., switch], axis=1), axis=1) - 1
        assert set(edges.tolist()) <= {0, 2, 4, 6, 8, 10}
        assert {2, 10} <= set(edges.tolist())
        assert np.array_equal(bits[:, 0], rest[:, 0])
        assert np.array_equal(bits[:, -1], rest[:, -1])


def test_bursts_are_of_any_length_up_to_the_limit() -> None:
    rest, bits = bounced(finely(ON_US, ON_US + 3000, n=600))
    wrong = rest[..., 0] != bits[..., 0]
    lasts_us = 10.0 * (wrong.shape[1] - np.argmax(wrong[:, ::-1], axis=1)) * wrong.any(axis=1)
    assert lasts_us.max() > 2900.0
    assert 1350.0 < lasts_us.mean() < 1550.0


def test_the_limits_are_those_of_the_scene() -> None:
    rest, bits = bounced(finely(OFF_US, OFF_US + 30_000), {"on_ms": 0.0, "off_ms": 20.0})
    wrong = np.flatnonzero((rest != bits).any(axis=(0, 2)))
    assert 15_000 < 10 * wrong.max() < 20_000
    rest, bits = bounced(finely(ON_US, ON_US + 3000), {"on_ms": 0.0})
    assert np.array_equal(rest, bits)


def test_a_switch_opening_during_chatter_stays_open() -> None:
    """The first switch opens 80 ms after it closed, in the midst of bursts of up to a second."""
    rest, bits = bounced(finely(ON_US, OFF_US + 50_000), {"on_ms": 1000.0, "off_ms": 0.0})
    opened = (OFF_US - ON_US) // 10
    assert (rest[:, :opened, 0] != bits[:, :opened, 0]).any()
    assert not bits[:, opened:, 0].any()


def test_switches_bounce_when_they_are_read_not_when_the_frame_begins() -> None:
    at = finely(ON_US, ON_US + 3000)
    early = bounced(at - 500, delay_us=np.full(4, 500))
    assert np.array_equal(early, bounced(at))
    assert np.array_equal(bounced(at - 500, delay_us=np.full((*at.shape, 4), 500)), early)
