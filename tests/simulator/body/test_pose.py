"""Poses against scipy's rotations, and against their own inverses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from thenar.simulator.body.shapes import Box, Pose, Sphere, rotation, rotation_vector

AXES = arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)).filter(lambda v: np.linalg.norm(v) > 0.1)
# Everything from nothing to half a turn, and closely by both.
TURNS = st.one_of(
    st.floats(0.0, np.pi),
    st.floats(-300.0, 0.0).map(lambda power: 10.0**power),
    st.floats(-16.0, -1.0).map(lambda power: np.pi - 10.0**power),
    st.just(np.pi),
)
VECTORS = st.builds(lambda axis, angle: axis / np.linalg.norm(axis) * angle, AXES, TURNS)
PLACES = arrays(np.float64, 3, elements=st.floats(-300.0, 300.0))
BOX = Box(length_mm=60.0, width_mm=30.0, height_mm=10.0)
BALL = Sphere(diameter_mm=40.0)


def pose_of(place: np.ndarray, vector: np.ndarray) -> Pose:
    return Pose.of(np.concatenate([place, vector])[:, None])


@given(VECTORS)
def test_a_rotation_is_scipys(vector: np.ndarray) -> None:
    assert rotation(vector[:, None])[..., 0] == pytest.approx(Rotation.from_rotvec(vector).as_matrix(), abs=1e-15)


@given(VECTORS)
def test_rotation_vectors_survive_their_matrices_up_to_half_a_turn(vector: np.ndarray) -> None:
    back = rotation_vector(rotation(vector[:, None]))[:, 0]
    # Half a turn one way is half a turn the other way.
    other = back - 2 * np.pi * back / max(float(np.linalg.norm(back)), 1e-300)
    assert min(np.abs(back - vector).max(), np.abs(other - vector).max()) < 4e-15


@given(AXES, st.floats(-150.0, -3.0).map(lambda power: 10.0**power))
def test_small_turns_keep_all_their_digits(axis: np.ndarray, angle: float) -> None:
    vector = axis / np.linalg.norm(axis) * angle
    assert rotation_vector(rotation(vector[:, None]))[:, 0] == pytest.approx(vector, rel=1e-14, abs=1e-15 * angle)


@given(arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_the_rotation_vector_of_any_matrix_is_scipys(quaternion: np.ndarray) -> None:
    known = Rotation.from_quat(quaternion)
    found = rotation_vector(known.as_matrix()[:, :, None])[:, 0]
    assert np.linalg.norm(found) <= np.pi + 1e-15
    assert Rotation.from_rotvec(found).as_matrix() == pytest.approx(known.as_matrix(), abs=1e-14)


@given(VECTORS, PLACES, arrays(np.float64, (4, 3, 1), elements=st.floats(-100.0, 100.0)))
def test_inward_undoes_outward(vector: np.ndarray, place: np.ndarray, points: np.ndarray) -> None:
    pose = pose_of(place, vector)
    assert pose.inward(pose.outward(points) + pose.position) == pytest.approx(points, abs=1e-12)


@given(VECTORS, PLACES, arrays(np.float64, (4, 3, 1), elements=st.floats(-100.0, 100.0)))
def test_outward_turns_as_scipy_does(vector: np.ndarray, place: np.ndarray, points: np.ndarray) -> None:
    known = Rotation.from_rotvec(vector).apply(points[..., 0])
    assert pose_of(place, vector).outward(points)[..., 0] == pytest.approx(known, abs=1e-12)


@given(VECTORS, PLACES, VECTORS, PLACES)
def test_poses_shift_and_turn_about_the_hands_axes(
    vector: np.ndarray, place: np.ndarray, turn: np.ndarray, shift: np.ndarray
) -> None:
    moved = pose_of(place, vector).moved(np.concatenate([shift, turn])[:, None])
    known = (Rotation.from_rotvec(turn) * Rotation.from_rotvec(vector)).as_matrix()
    assert moved.position[:, 0] == pytest.approx(place + shift, abs=1e-12)
    assert moved.rotation[..., 0] == pytest.approx(known, abs=1e-14)


@given(VECTORS, PLACES, arrays(np.float64, (4, 3, 1), elements=st.floats(-100.0, 100.0)))
def test_distance_ignores_common_motion_of_hand_and_object(
    vector: np.ndarray, place: np.ndarray, points: np.ndarray
) -> None:
    pose = pose_of(place, vector)
    seen = pose.outward(points) + pose.position
    assert pose.distance(BOX, seen)[0] == pytest.approx(BOX.distance(points)[0], abs=1e-11)
    off = points + np.array([0.0, 0.0, 200.0])[:, None]  # a ball has no creases, only a middle
    distance, normal = pose.distance(BALL, pose.outward(off) + pose.position)
    assert distance == pytest.approx(BALL.distance(off)[0], abs=1e-11)
    assert normal == pytest.approx(pose.outward(BALL.distance(off)[1]), abs=1e-11)
