"""A hand has published proportions, its frames are rotations, its joints turn what hangs on them, its thumb opposes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.simulator.body.hand import BASES, CAPSULES, DIGITS, DOF, LIMITS_DEG, RADII, SEGMENTS, Hand, Size

HAND = Hand(Size(185.0, 83.0))
SIZES = st.builds(Size, length_mm=st.floats(150.0, 230.0), breadth_mm=st.floats(65.0, 105.0))
ANGLES = arrays(np.float64, 20, elements=st.floats(0.0, 1.0)).map(
    lambda share: np.radians(LIMITS_DEG[:, 0] + share * (LIMITS_DEG[:, 1] - LIMITS_DEG[:, 0]))
)
BENDS = st.integers(0, 19)
STEP = 1e-6
# Thumb abducted and flexed, index finger bent at the knuckle to meet it.
OPPOSED_DEG = {
    "thumb_cmc_abduction": 70.0, "thumb_cmc_flexion": 30.0, "index_abduction": -10.0, "index_mcp": 70.0,
    "index_pip": 10.0, "index_dip": 10.0,
}  # fmt: skip


def posture(degrees: dict[str, float]) -> np.ndarray:
    return np.radians([[degrees.get(joint, 0.0)] for joint in DOF])


def digit_of(capsule: int) -> int:
    return capsule // 3 if capsule < 15 else -1


@given(ANGLES, BENDS)
def test_a_joint_turns_only_the_skin_beyond_it(angles: np.ndarray, joint: int) -> None:
    digit, number = divmod(joint, 4)
    skeleton = HAND.skeleton(angles[:, None])
    step = STEP * np.eye(20)[:, [joint]]
    there, back = (HAND.spheres(HAND.skeleton(angles[:, None] + way))[..., 0] for way in (step, -step))
    lever = HAND.spheres(skeleton)[..., 0] - skeleton.centres[digit, number, :, 0]
    turned = np.cross(skeleton.axes[digit, number, :, 0], lever)
    # The first two joints move all three segments, each of the others one fewer.
    beyond = [digit_of(capsule) == digit and capsule % 3 >= number - 1 for capsule in HAND.sphere_capsules]
    expected = np.where(np.array(beyond)[:, None], turned, 0.0)
    assert (there - back) / (2 * STEP) == pytest.approx(expected, abs=1e-6)


@given(ANGLES)
def test_axes_are_of_unit_length_and_joints_lie_where_segments_begin(angles: np.ndarray) -> None:
    skeleton = HAND.skeleton(angles[:, None])
    assert np.linalg.norm(skeleton.axes, axis=2) == pytest.approx(1.0, abs=1e-14)
    starts = skeleton.origins[:15].reshape(5, 3, 3, 1)
    assert np.array_equal(skeleton.centres, starts[:, [0, 0, 1, 2]])


@given(SIZES, ANGLES)
def test_segments_follow_one_another_at_their_published_lengths(size: Size, angles: np.ndarray) -> None:
    hand = Hand(size)
    skeleton = hand.skeleton(angles[:, None])
    starts = skeleton.origins[:15, :, 0].reshape(5, 3, 3)
    apart = np.linalg.norm(np.diff(starts, axis=1), axis=2)
    assert apart == pytest.approx(size.segments_mm()[:, :2], rel=1e-12)
    along = skeleton.frames[:15, :, 0, 0].reshape(5, 3, 3)
    assert np.diff(starts, axis=1) == pytest.approx(along[:, :2] * apart[..., None], rel=1e-9, abs=1e-9)
    assert hand.lengths[:15] == pytest.approx(size.segments_mm().ravel(), rel=1e-15)


def test_a_flat_hand_points_distal_and_looks_to_the_palm() -> None:
    skeleton = HAND.skeleton(np.zeros((20, 1)))
    fingers = skeleton.frames[3:15, :, :, 0]
    assert (fingers[:, 0, 0] > 0.98).all()
    assert fingers[:, 2, 2] == pytest.approx(1.0)
    tips = HAND.spheres(skeleton)[[13, 20, 27, 34], :, 0]
    assert (np.diff(tips[:, 1]) < 0.0).all()  # index on the radial side


@pytest.mark.parametrize("finger", ["index", "middle", "ring", "little"])
def test_a_finger_bends_to_the_palm_and_abducts_to_the_radial_side(finger: str) -> None:
    tip = 7 * ("thumb", "index", "middle", "ring", "little").index(finger) + 6
    flat = HAND.spheres(HAND.skeleton(np.zeros((20, 1))))[tip, :, 0]
    for joint in ("mcp", "pip", "dip"):
        bent = HAND.spheres(HAND.skeleton(posture({f"{finger}_{joint}": 40.0})))[tip, :, 0]
        assert bent[2] < flat[2]
    aside = HAND.spheres(HAND.skeleton(posture({f"{finger}_abduction": 10.0})))[tip, :, 0]
    assert aside[1] > flat[1]


def test_the_thumb_opposes() -> None:
    skeleton = HAND.skeleton(posture(OPPOSED_DEG))
    thumb, index = (CAPSULES.index(name) for name in ("thumb_distal", "index_distal"))
    tips = HAND.spheres(skeleton)[[6, 13], :, 0]
    way = (tips[1] - tips[0]) / np.linalg.norm(tips[1] - tips[0])
    thumb_pad, index_pad = (-skeleton.frames[capsule, :, 2, 0] for capsule in (thumb, index))
    # Pads face each other, with a marble's room between them.
    assert thumb_pad @ way > np.cos(np.radians(30.0))
    assert index_pad @ -way > np.cos(np.radians(30.0))
    assert thumb_pad @ index_pad < -0.65
    room = np.linalg.norm(tips[1] - tips[0]) - HAND.radii[thumb] - HAND.radii[index]
    assert 5.0 < room < 20.0


def test_spheres_lie_on_the_axes_of_their_capsules() -> None:
    skeleton = HAND.skeleton(posture(OPPOSED_DEG))
    relative = HAND.spheres(skeleton) - skeleton.origins[HAND.sphere_capsules]
    own = np.einsum("mxkn,mxn->mk", skeleton.frames[HAND.sphere_capsules], relative)
    assert own[:, 0] == pytest.approx(HAND.sphere_offsets)
    assert own[:, 1:] == pytest.approx(0.0, abs=1e-12)
    assert (HAND.sphere_offsets <= HAND.lengths[HAND.sphere_capsules]).all()


# Buchholz, Armstrong and Goldstein 1992, Table 2: segments over hand length, proximal to distal.
BUCHHOLZ = {
    "thumb": (0.251, 0.196, 0.158),
    "index": (0.245, 0.143, 0.097),
    "middle": (0.266, 0.170, 0.108),
    "ring": (0.244, 0.165, 0.107),
    "little": (0.204, 0.117, 0.093),
}


@given(SIZES)
def test_segments_are_as_published_times_the_length_of_the_hand(size: Size) -> None:
    expected = [[share * size.length_mm for share in BUCHHOLZ[digit]] for digit in DIGITS]
    assert size.segments_mm() == pytest.approx(np.array(expected), rel=1e-12)


@given(SIZES, st.floats(0.5, 2.0))
def test_hands_of_one_shape_are_alike(size: Size, scale: float) -> None:
    larger = Size(size.length_mm * scale, size.breadth_mm * scale)
    for measure in (Size.segments_mm, Size.bases_mm, Size.radii_mm):
        assert measure(larger) == pytest.approx(scale * measure(size), rel=1e-12)


@given(SIZES, st.floats(0.8, 1.2))
def test_a_broader_hand_is_thicker_and_not_longer(size: Size, scale: float) -> None:
    broader = Size(size.length_mm, size.breadth_mm * scale)
    assert np.array_equal(broader.segments_mm(), size.segments_mm())
    assert broader.radii_mm() == pytest.approx(scale * size.radii_mm(), rel=1e-12)


def test_fingers_thin_towards_their_tips() -> None:
    assert (np.diff(RADII, axis=1) < 0.0).all()


def test_the_longest_middle_finger_reaches_the_hands_length() -> None:
    reach = BASES[1:, 0] + SEGMENTS[1:].sum(axis=1)
    assert reach.argmax() == 1
    # A straight middle finger ends a hand: within a fingertip's half thickness.
    assert reach[1] == pytest.approx(1.0, abs=0.02)


def test_knuckles_stand_in_a_row_across_the_breadth_of_the_hand() -> None:
    across = BASES[1:, 1]
    assert (np.diff(across) < 0.0).all()
    assert 0.5 < across[0] - across[-1] < 0.8  # from axis to axis, without the outer halves of index and little finger
