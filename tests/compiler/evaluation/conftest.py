"""Sets of grasps with a structure that the tests know."""

from collections.abc import Iterator

import numpy as np
import pytest

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.trainers.base import TRAINERS

from ...sets import grasp_set_of

TYPES = ("hook", "pinch", "power", "tip")


def make_grasps(
    n_switches: int = 12,
    n_joints: int = 2,
    subjects: str = "AB",
    per_type: int = 12,
    noise: float = 0.1,
    seed: int = 1,
) -> GraspSet:
    """Every subject grasps each type `per_type` times: a random prototype a type, bits flipped by `noise`."""
    random = np.random.default_rng(seed)
    labels = np.tile(np.repeat(np.arange(len(TYPES)), per_type), len(subjects))
    bits = (random.random((len(TYPES), n_switches)) < 0.5)[labels]
    angles = random.integers(20, 200, (len(TYPES), n_joints))[labels]
    return grasp_set_of(
        TYPES,
        labels,
        switches=bits ^ (random.random(bits.shape) < noise),
        codes=angles + random.integers(-20, 21, angles.shape),
        joints=tuple(Joint(f"j{i}", "deg", 0, 0.0, 200, 100.0) for i in range(n_joints)),
        subjects=np.repeat(list(subjects), len(TYPES) * per_type),
        objects=np.tile(["cup", "pen"], len(labels) // 2),
        trials=np.tile(np.arange(per_type), len(subjects) * len(TYPES)),
    )


@pytest.fixture(scope="module", autouse=True)
def _two_ways_to_train() -> Iterator[None]:
    """Let trainers compare few rounds, or few penalties: how they choose is tested where it is done."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(TRAINERS["logitboost"], "tried", ({"rounds": 2}, {"rounds": 5}))
        patched.setattr(TRAINERS["logit"], "tried", ({"penalty": 1.0, "max_bins": 4},))
        patched.setattr(TRAINERS["pairs"], "tried", ({"max_bins": 4, "pairs": 1, "pair_bins": 2},))
        yield
