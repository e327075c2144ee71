"""The object's pose varies from repetition to repetition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from thenar.simulator.effects.hand_object_pose import MEMBER, prepare, turned

from ..small import make_batch, make_draw, make_setting

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
    prepare(make_setting(), sd_mm=2.0, sd_deg=3.0)(batch, make_draw(MEMBER.name, batch))
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
        prepare(make_setting(), **parameters)(batch, make_draw(MEMBER.name, batch))
        np.testing.assert_array_equal(batch.pose[:, still], before[:, still])
        assert (batch.pose != before).any()
