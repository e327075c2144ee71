"""The torques of a grip do the work of the pads that press."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.simulator.body.condition import Condition, Pad, PlannedGrasp, Thing
from thenar.simulator.body.hand import LIMITS_DEG, Hand, Size
from thenar.simulator.body.shapes import Box, Cylinder, Pose, Shape, Sphere
from thenar.simulator.contact.model import torques

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
