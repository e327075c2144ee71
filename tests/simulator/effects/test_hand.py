"""Posture, grip and the object's pose vary from repetition to repetition, and by subjects, each of whom has a style."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from thenar.simulator.body.hand import LIMITS_DEG
from thenar.simulator.effects import hand_grip, hand_object_pose, hand_posture, hand_style
from thenar.simulator.effects.hand_object_pose import turned
from thenar.simulator.pipeline.batch import Batch

from ..small import make_batch, make_condition, make_draw, make_setting


def shifted(sd_deg: float, n: int) -> Batch:
    batch = make_batch(range(n))
    batch.posture_deg = np.tile(batch.condition.held.posture_deg, (n, 1))
    hand_posture.prepare(make_setting(), sd_deg=sd_deg)(batch, make_draw(hand_posture.MEMBER.name, batch))
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


def test_grip_is_lognormal_about_what_was_planned() -> None:
    batch = make_batch(range(4000))
    batch.grip_n = np.full(4000, 12.0)
    hand_grip.prepare(make_setting(), log_sd=0.25)(batch, make_draw(hand_grip.MEMBER.name, batch))
    logs = np.log(batch.grip_n / 12.0)
    # Four standard errors: 0.25 / sqrt(4000), and over sqrt(2) for the sd.
    assert abs(logs.mean()) < 4 * 0.004
    assert abs(logs.std() - 0.25) < 4 * 0.0028
    assert (batch.grip_n > 0.0).all()


VECTORS = arrays(np.float64, (3, 3), elements=st.floats(-1.8, 1.8))  # up to half a turn
DIRECTIONS = arrays(np.float64, (3, 3), elements=st.floats(-1.0, 1.0))


@given(vectors=VECTORS, directions=DIRECTIONS, size=st.floats(0.0, 0.05))
def test_a_small_turn_is_linear_in_the_hands_axes(vectors: np.ndarray, directions: np.ndarray, size: float) -> None:
    turns = size * directions
    got = Rotation.from_rotvec(turned(vectors, turns))
    truth = Rotation.from_rotvec(turns) * Rotation.from_rotvec(vectors)
    # The next term of the expansion is a twelfth of |turn|^2 |vector| for small vectors; by half a turn it has grown to
    # 0.4 |turn|^2 (measured on 200 000). scipy's own angles are good to 1e-7 here.
    off = (got * truth.inv()).magnitude()
    assert (off <= 0.5 * (turns**2).sum(axis=1) + 1e-7).all()


@pytest.mark.parametrize("length", [0.0, 1e-9, 1e-5, 1.9e-4, 2.1e-4, 1.0, np.pi, 3.2])
def test_it_holds_next_to_no_rotation_and_about_half_a_turn(length: float) -> None:
    vector, turn = np.array([[0.0, 0.6, 0.8]]) * length, np.array([[0.01, -0.02, 0.015]])
    got = Rotation.from_rotvec(turned(vector, turn))
    truth = Rotation.from_rotvec(turn) * Rotation.from_rotvec(vector)
    assert np.all((got * truth.inv()).magnitude() < (turn**2).sum())


def test_places_and_turns_vary_as_much_as_is_asked() -> None:
    batch = make_batch(range(2000))
    held = batch.condition.held.pose
    batch.pose = np.tile(held, (2000, 1))
    hand_object_pose.prepare(make_setting(), sd_mm=2.0, sd_deg=3.0)(
        batch, make_draw(hand_object_pose.MEMBER.name, batch)
    )
    # Four standard errors are 4 / sqrt(2000) = 9 % of the sd for the mean, 4 / sqrt(4000) = 6.4 % for the sd itself.
    off = batch.pose[:, :3] - held[:3]
    assert np.abs(off.mean(axis=0)).max() < 0.09 * 2.0
    assert np.abs(off.std(axis=0) - 2.0).max() < 0.064 * 2.0
    turns = np.degrees((Rotation.from_rotvec(batch.pose[:, 3:]) * Rotation.from_rotvec(held[3:]).inv()).as_rotvec())
    assert np.abs(turns.mean(axis=0)).max() < 0.09 * 3.0
    assert np.abs(turns.std(axis=0) - 3.0).max() < 0.064 * 3.0


def test_either_can_be_left_out() -> None:
    for parameters, still in (({"sd_mm": 0.0}, slice(0, 3)), ({"sd_deg": 0.0}, slice(3, 6))):
        batch = make_batch()
        before = batch.pose = np.tile(batch.condition.held.pose, (4, 1))
        hand_object_pose.prepare(make_setting(), **parameters)(batch, make_draw(hand_object_pose.MEMBER.name, batch))
        np.testing.assert_array_equal(batch.pose[:, still], before[:, still])
        assert (batch.pose != before).any()


# Far from all limits, so that nothing is clipped unless a test wants it.
MIDDLE = LIMITS_DEG.mean(axis=1)


def style(
    subject: str, grasp: str, thing: str = "bar", parameters: dict[str, float] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far the posture is off (n, 20), and the factor of the grip (n,)."""
    batch = make_batch(range(2), make_condition(subject, grasp, thing))
    batch.posture_deg, batch.grip_n = np.tile(MIDDLE, (2, 1)), np.full(2, 10.0)
    hand_style.prepare(make_setting(), **(parameters or {}))(batch, make_draw(hand_style.MEMBER.name, batch))
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


def test_no_style_leaves_a_joints_range() -> None:
    posture, _ = style("A", "PoS", "bar", {"sd_deg": 45.0, "habit_sd_deg": 45.0})
    assert (posture + MIDDLE >= LIMITS_DEG[:, 0] - 1e-9).all()
    assert (posture + MIDDLE <= LIMITS_DEG[:, 1] + 1e-9).all()
