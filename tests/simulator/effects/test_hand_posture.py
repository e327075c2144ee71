"""Joint angles vary from repetition to repetition."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.body.hand import LIMITS_DEG
from thenar.simulator.effects.hand_posture import MEMBER, prepare
from thenar.simulator.pipeline.batch import Batch

from ..small import make_batch, make_draw, make_setting


def shifted(sd_deg: float, n: int) -> Batch:
    batch = make_batch(range(n))
    batch.posture_deg = np.tile(batch.condition.held.posture_deg, (n, 1))
    prepare(make_setting(), sd_deg=sd_deg)(batch, make_draw(MEMBER.name, batch))
    return batch


def test_each_angle_varies_as_much_as_is_asked_and_by_itself() -> None:
    batch = shifted(1.5, 2000)
    off = batch.posture_deg - batch.condition.held.posture_deg
    # Nothing was clipped: no planned angle is within 6 sd of its limit. Standard errors are 1.5 / sqrt(2000) = 0.034 of
    # the mean, 0.024 of the sd, 0.022 of a correlation; the largest of 20 or 190 stays within 4.5 of them.
    assert np.abs(off.mean(axis=0)).max() < 4.5 * 0.034
    assert np.abs(off.std(axis=0) - 1.5).max() < 4.5 * 0.024
    assert np.abs(np.corrcoef(off.T) - np.eye(20)).max() < 4.5 * 0.0224


@given(sd_deg=st.floats(0.0, 45.0))
def test_no_joint_leaves_its_range(sd_deg: float) -> None:
    posture = shifted(sd_deg, 5).posture_deg
    assert (posture >= LIMITS_DEG[:, 0]).all()
    assert (posture <= LIMITS_DEG[:, 1]).all()
