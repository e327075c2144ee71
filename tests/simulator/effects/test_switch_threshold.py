"""Each switch closes at a force of its own."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.effects.switch_threshold import LEAST_N, MEMBER, prepare

from ..small import make_batch, make_condition, make_draw, make_setting


def thresholds(subject: str, sd_n: float) -> np.ndarray:
    """Return the thresholds (160,) about 1 N."""
    batch = make_batch(range(1), make_condition(subject))
    batch.thresholds_n = np.ones(160)
    prepare(make_setting(), sd_n=sd_n)(batch, make_draw(MEMBER.name, batch))
    return batch.thresholds_n


def test_thresholds_spread_about_the_gloves_as_much_as_is_asked() -> None:
    found = thresholds("A", 0.15)
    # Four standard errors of mean and sd of 160; 0.2 N is 5 sd away.
    assert abs(found.mean() - 1.0) < 4 * 0.15 / 160**0.5
    assert abs(found.std() - 0.15) < 4 * 0.15 / 320**0.5
    assert len(set(found.tolist())) == 160


def test_everybody_wears_the_same_glove() -> None:
    np.testing.assert_array_equal(thresholds("A", 0.15), thresholds("B", 0.15))


@given(sd_n=st.floats(0.0, 5.0))
def test_no_switch_closes_by_itself(sd_n: float) -> None:
    assert thresholds("A", sd_n).min() >= LEAST_N
