"""A grip's torques do the work of the pads that press; a capsule shares its force among its switches without loss."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.simulator.body.condition import Condition, Pad, PlannedGrasp, Thing
from thenar.simulator.body.hand import CAPSULES, LIMITS_DEG, Hand, Size
from thenar.simulator.body.layout import SwitchPlaces, murakami160
from thenar.simulator.body.shapes import Box, Cylinder, Pose, Shape, Sphere
from thenar.simulator.contact.model import split, torques

HAND = Hand(Size(185.0, 83.0))
POSE = np.array([90.0, 5.0, -40.0, 0.2, -0.1, 0.7])
SHAPES = st.sampled_from((Sphere(diameter_mm=60.0), Cylinder(diameter_mm=40.0, length_mm=120.0), Box(50.0, 70.0, 30.0)))
ANGLES = arrays(np.float64, 20, elements=st.floats(0.0, 1.0)).map(
    lambda share: np.radians(LIMITS_DEG[:, 0] + share * (LIMITS_DEG[:, 1] - LIMITS_DEG[:, 0]))
)
PADS = st.lists(
    st.builds(Pad, sphere=st.integers(0, len(HAND.sphere_capsules) - 1), share=st.floats(0.01, 1.0)), min_size=1
).map(tuple)
STEP = 1e-5


def condition(shape: Shape, pads: tuple[Pad, ...]) -> Condition:
    held = PlannedGrasp(np.zeros(20), POSE, pads, 10.0)
    return Condition("A", HAND, "PoS", Thing("thing", shape, 0.1), held)


def torques_at(given: Condition, angles: np.ndarray) -> np.ndarray:
    return torques(given, HAND.skeleton(angles[:, None]), Pose.of(POSE[:, None]))[:, 0]


@given(ANGLES, SHAPES, PADS)
def test_a_small_turn_of_a_joint_does_the_work_of_the_pads(
    angles: np.ndarray, shape: Shape, pads: tuple[Pad, ...]
) -> None:
    # Virtual work: the pads' pushes are held fixed, every joint in turn is moved a little either way.
    spheres = [pad.sphere for pad in pads]
    pose = Pose.of(POSE[:, None])
    centres = HAND.spheres(HAND.skeleton(angles[:, None]))[spheres]
    push = -np.array([pad.share for pad in pads])[:, None] * pose.distance(shape, centres)[1][:, :, 0]
    moved = angles[:, None] + STEP * np.concatenate([np.eye(20), -np.eye(20)], axis=1)
    ways = HAND.spheres(HAND.skeleton(moved))[spheres]
    work = ((ways[:, :, :20] - ways[:, :, 20:]) * push[:, :, None]).sum(axis=(0, 1)) / (2 * STEP)
    assert torques_at(condition(shape, pads), angles) == pytest.approx(work, rel=1e-6, abs=1e-4)


SWITCHES = SwitchPlaces(Hand(Size(185.0, 83.0)), murakami160())
N_SWITCHES = len(SWITCHES.capsules)
# Many at the surface and outside, so that capsules of which no switch, one or all touch come up.
DEPTHS_MM = st.sampled_from((-5.0, -1e-9, 0.0)) | st.floats(1e-15, 10.0)


@st.composite
def pressed(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    n = draw(st.integers(1, 3))
    depths = draw(arrays(np.float64, (N_SWITCHES, n), elements=DEPTHS_MM, fill=DEPTHS_MM))
    forces = draw(arrays(np.float64, (len(CAPSULES), n), elements=st.floats(0.0, 100.0)))
    return depths, forces


@given(pressed())
def test_each_capsule_keeps_its_own_force(case: tuple[np.ndarray, np.ndarray]) -> None:
    depths, forces = case
    shared, _ = split(SWITCHES, depths, forces)
    for capsule, force in enumerate(forces):
        own = SWITCHES.capsules == capsule
        touched = (depths[own] > 0.0).any(axis=0)
        assert shared[own].sum(axis=0) == pytest.approx(np.where(touched, force, 0.0), rel=1e-12)


@given(pressed())
def test_within_a_capsule_force_is_in_proportion_to_depth(case: tuple[np.ndarray, np.ndarray]) -> None:
    depths, forces = case
    shared, _ = split(SWITCHES, depths, forces)
    sunk = np.maximum(depths, 0.0)
    for capsule in range(len(CAPSULES)):
        own = SWITCHES.capsules == capsule
        deepest, most = sunk[own].max(axis=0), shared[own].max(axis=0)
        assert shared[own] * deepest == pytest.approx(sunk[own] * most, rel=1e-9, abs=1e-12)


@given(st.sampled_from((5e-324, 1e-310, 1e-300)), st.sampled_from((5e-324, 1.0, 1e300)))
def test_tiny_depths_share_the_force(depth: float, force: float) -> None:
    depths = np.full((N_SWITCHES, 1), -1.0)
    depths[:2] = depth
    forces = np.zeros((len(CAPSULES), 1))
    forces[SWITCHES.capsules[0]] = force
    shared, between = split(SWITCHES, depths, forces)
    assert shared[:2].sum() == pytest.approx(force, rel=1e-15)
    assert shared[0, 0] == shared[1, 0] or force == 5e-324
    assert not between.any()
