"""Every subject has a style: habits of posture, also by grasp type, and a grip of their own."""

import numpy as np

from thenar.simulator.body.hand import LIMITS_DEG
from thenar.simulator.effects.hand_style import MEMBER, prepare

from ..small import make_batch, make_condition, make_draw, make_setting

# Far from all limits, so that nothing is clipped unless a test wants it.
MIDDLE = LIMITS_DEG.mean(axis=1)


def style(
    subject: str, grasp: str, thing: str = "bar", parameters: dict[str, float] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far the posture is off (n, 20), and the factor of the grip (n,)."""
    batch = make_batch(range(2), make_condition(subject, grasp, thing))
    batch.posture_deg, batch.grip_n = np.tile(MIDDLE, (2, 1)), np.full(2, 10.0)
    prepare(make_setting(), **(parameters or {}))(batch, make_draw(MEMBER.name, batch))
    return batch.posture_deg - MIDDLE, batch.grip_n / 10.0


def test_a_style_is_the_same_in_every_repetition_and_with_every_object() -> None:
    (posture, grip), (again, same) = style("A", "PoS", "bar"), style("A", "PoS", "ball")
    np.testing.assert_array_equal(posture[0], posture[1])
    np.testing.assert_array_equal(posture, again)
    assert len({*grip.tolist(), *same.tolist()}) == 1
    assert np.abs(posture).min() > 0.0


def test_each_type_has_its_own_habit_but_common_grip() -> None:
    (one, grip), (other, same) = style("A", "PoS"), style("A", "Lat")
    assert (one != other).all()
    assert grip.tolist() == same.tolist()


def test_habits_are_per_type_and_the_rest_common() -> None:
    for_all = {"habit_sd_deg": 0.0}
    np.testing.assert_array_equal(style("A", "PoS", "bar", for_all)[0], style("A", "Lat", "bar", for_all)[0])
    habits = {"sd_deg": 0.0, "log_sd": 0.0}
    posture, grip = style("A", "PoS", "bar", habits)
    assert (posture != 0.0).all()
    assert grip.tolist() == [1.0, 1.0]


def test_subjects_differ_as_much_as_is_asked() -> None:
    parameters = {"sd_deg": 1.0, "habit_sd_deg": 2.0, "log_sd": 0.2}
    styles = [style(f"subject {number}", "PoS", "bar", parameters) for number in range(300)]
    off, logs = np.stack([s[0][0] for s in styles]), np.log([s[1][0] for s in styles])
    # 6000 angles of sd sqrt(1 + 4), 300 grips; four standard errors of an sd are 4 sd / sqrt(2 n).
    assert abs(off.std() - 5.0**0.5) < 4 * 5.0**0.5 / 12000**0.5
    assert abs(logs.std() - 0.2) < 4 * 0.2 / 600**0.5


def test_no_joint_leaves_its_range() -> None:
    posture, _ = style("A", "PoS", "bar", {"sd_deg": 45.0, "habit_sd_deg": 45.0})
    assert (posture + MIDDLE >= LIMITS_DEG[:, 0] - 1e-9).all()
    assert (posture + MIDDLE <= LIMITS_DEG[:, 1] + 1e-9).all()
