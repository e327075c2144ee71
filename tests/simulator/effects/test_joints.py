"""Joint sensors are noisy, by the frame and by the repetition, and their calibration drifts as a session goes on."""

import numpy as np

from thenar.simulator.effects import joint_drift, joint_noise
from thenar.simulator.pipeline.effect import frame_times

from ..small import make_batch, make_condition, make_draw, make_setting


def noise(n: int, timed: bool, sd_deg: float, trial_sd_deg: float = 0.0) -> np.ndarray:
    """Return what is added to n repetitions (n, F, 18)."""
    batch, setting = make_batch(range(n)), make_setting(timed=timed)
    batch.sensors_deg = np.full((n, len(frame_times(setting)), 18), 50.0)
    joint_noise.prepare(setting, sd_deg=sd_deg, trial_sd_deg=trial_sd_deg)(
        batch, make_draw(joint_noise.MEMBER.name, batch)
    )
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


def drift(subject: str, trials: list[int], deg_per_session: float = 5.0) -> np.ndarray:
    """Return what is added in these trials of 100 (n, 2 frames, 18)."""
    batch = make_batch(range(len(trials)), make_condition(subject))
    batch.trials = np.array(trials)
    batch.sensors_deg = np.zeros((len(trials), 2, 18))
    joint_drift.prepare(make_setting(session_trials=100), deg_per_session=deg_per_session)(
        batch, make_draw(joint_drift.MEMBER.name, batch)
    )
    return batch.sensors_deg


def test_it_begins_at_nought_and_goes_on_in_a_straight_line() -> None:
    added = drift("A", [0, 25, 50, 100])
    assert not added[0].any()
    np.testing.assert_allclose(added[2], 2.0 * added[1], rtol=1e-12)
    np.testing.assert_allclose(added[3], 4.0 * added[1], rtol=1e-12)
    np.testing.assert_array_equal(added[:, 0], added[:, 1])


def test_every_subjects_sensors_drift_independently_by_the_requested_amount() -> None:
    ends = np.stack([drift(f"subject {number}", [100], deg_per_session=8.0)[0, 0] for number in range(200)])
    # 3600 drifts: four standard errors of mean and sd.
    assert abs(ends.mean()) < 4 * 8.0 / 3600**0.5
    assert abs(ends.std() - 8.0) < 4 * 8.0 / 7200**0.5
    assert (ends > 0.0).any()
    assert (ends < 0.0).any()
