"""Noise on the joint sensors: a draw a frame, and one for the whole repetition."""

import numpy as np

from thenar.simulator.effects.joint_noise import MEMBER, prepare
from thenar.simulator.pipeline.effect import frame_times

from ..small import make_batch, make_draw, make_setting


def noise(n: int, timed: bool, sd_deg: float, trial_sd_deg: float = 0.0) -> np.ndarray:
    """Return what is added to n repetitions (n, F, 18)."""
    batch, setting = make_batch(range(n)), make_setting(timed=timed)
    batch.sensors_deg = np.full((n, len(frame_times(setting)), 18), 50.0)
    prepare(setting, sd_deg=sd_deg, trial_sd_deg=trial_sd_deg)(batch, make_draw(MEMBER.name, batch))
    return batch.sensors_deg - 50.0


def test_every_frame_has_noise_of_its_own() -> None:
    added = noise(40, True, sd_deg=2.0)
    count = added.size
    # Four standard errors of mean and sd.
    assert abs(added.mean()) < 4 * 2.0 / count**0.5
    assert abs(added.std() - 2.0) < 4 * 2.0 / (2 * count) ** 0.5
    assert abs(np.corrcoef(added[:, :-1].ravel(), added[:, 1:].ravel())[0, 1]) < 4 / count**0.5


def test_a_repetitions_offset_is_the_same_in_all_its_frames() -> None:
    added = noise(200, True, sd_deg=0.0, trial_sd_deg=5.0)
    np.testing.assert_array_equal(added, np.repeat(added[:, :1], added.shape[1], axis=1))
    assert abs(added[:, 0].std() - 5.0) < 4 * 5.0 / (2 * added[:, 0].size) ** 0.5
