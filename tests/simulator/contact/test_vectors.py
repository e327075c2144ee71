"""Products of many vectors at once, against numpy's and scipy's own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from thenar.simulator.body.shapes import rotation
from thenar.simulator.contact.balance import contract, cross, dot, length, turn, turned, wrench

NUMBERS = st.floats(-100.0, 100.0)
MANY = arrays(np.float64, (4, 3, 5), elements=NUMBERS)


@given(MANY, MANY)
def test_dot_and_cross_are_numpys(a: np.ndarray, b: np.ndarray) -> None:
    assert dot(a, b) == pytest.approx(np.einsum("mxn,mxn->mn", a, b), abs=1e-9)
    assert cross(a, b) == pytest.approx(np.cross(a, b, axis=1), abs=1e-9)


@given(arrays(np.float64, (3, 5), elements=NUMBERS))
def test_length_is_numpys(vectors: np.ndarray) -> None:
    assert length(vectors) == pytest.approx(np.linalg.norm(vectors, axis=0), rel=1e-14)


@given(arrays(np.float64, (4, 3, 3, 5), elements=NUMBERS), MANY)
def test_vectors_in_the_axes_of_frames_are_turned_by_them(frames: np.ndarray, vectors: np.ndarray) -> None:
    assert turned(frames, vectors) == pytest.approx(np.einsum("mxkn,mkn->mxn", frames, vectors), abs=1e-9)


@given(MANY, arrays(np.float64, (4, 6, 3, 5), elements=NUMBERS))
def test_a_wrench_is_force_and_moment(levers: np.ndarray, forces: np.ndarray) -> None:
    found = wrench(levers, forces)
    assert np.array_equal(found[:, :, :3], forces)
    assert found[:, :, 3:] == pytest.approx(np.cross(levers[:, None], forces, axis=2), abs=1e-9)


@given(arrays(np.float64, (2, 4, 3, 5), elements=NUMBERS), arrays(np.float64, (2, 6, 3, 5), elements=NUMBERS))
def test_contracting_sums_over_the_directions(a: np.ndarray, b: np.ndarray) -> None:
    assert contract(a, b) == pytest.approx(np.einsum("mixn,mjxn->mijn", a, b), abs=1e-9)


@given(arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)), arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)))
def test_a_turn_is_the_sine_of_its_angle_about_its_axis(then: np.ndarray, step: np.ndarray) -> None:
    now = (Rotation.from_rotvec(step) * Rotation.from_rotvec(then)).as_matrix()
    angle = np.linalg.norm(step)
    expected = step * (np.sin(angle) / angle if angle > 1e-12 else 1.0)
    found = turn(now[..., None], rotation(then[:, None]))[:, 0]
    assert found == pytest.approx(expected, abs=1e-12)
