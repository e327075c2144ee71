"""The calibration of the joint sensors drifts as a session goes on."""

import numpy as np

from thenar.simulator.effects.joint_drift import MEMBER, prepare

from ..small import make_batch, make_condition, make_draw, make_setting


def drift(subject: str, trials: list[int], deg_per_session: float = 5.0) -> np.ndarray:
    """Return what is added in these trials of 100 (n, 2 frames, 18)."""
    batch = make_batch(range(len(trials)), make_condition(subject))
    batch.trials = np.array(trials)
    batch.sensors_deg = np.zeros((len(trials), 2, 18))
    prepare(make_setting(session_trials=100), deg_per_session=deg_per_session)(batch, make_draw(MEMBER.name, batch))
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
