"""Grip force varies from repetition to repetition."""

import numpy as np

from thenar.simulator.effects.hand_grip import MEMBER, prepare

from ..small import make_batch, make_draw, make_setting


def test_grip_is_lognormal_about_what_was_planned() -> None:
    batch = make_batch(range(4000))
    batch.grip_n = np.full(4000, 12.0)
    prepare(make_setting(), log_sd=0.25)(batch, make_draw(MEMBER.name, batch))
    logs = np.log(batch.grip_n / 12.0)
    # Four standard errors: 0.25 / sqrt(4000), and over sqrt(2) for the sd.
    assert abs(logs.mean()) < 4 * 0.004
    assert abs(logs.std() - 0.25) < 4 * 0.0028
    assert (batch.grip_n > 0.0).all()
