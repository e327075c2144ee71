"""Grasps of contact.quasistatic against an independent program: the same hands and objects in MuJoCo."""

from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from thenar.simulator.body.condition import Condition
from thenar.simulator.body.hand import CAPSULES, LIMITS_DEG, Hand, Size
from thenar.simulator.effects.contact_quasistatic import Quasistatic

from ...conftest import lacking, module_at
from ..small import make_load

THRESHOLD_N = 1.0


@pytest.fixture(scope="module")
def oracle() -> ModuleType:
    if find_spec("mujoco") is None:
        lacking("mujoco")
    return module_at(Path(__file__).with_name("mujoco_oracle.py"))


def test_every_body_lies_where_the_hand_says(oracle: ModuleType, planned: dict[str, tuple[Condition, ...]]) -> None:
    hand, thing = Hand(Size(185.0, 83.0)), planned["kamakura"][0].thing
    for share in (0.0, 0.3, 1.0):
        angles = np.radians(LIMITS_DEG[:, 0] + share * (LIMITS_DEG[:, 1] - LIMITS_DEG[:, 0]))
        bodies = oracle.build(hand, thing)
        data = oracle.mujoco.MjData(bodies)
        data.qpos[:20] = angles
        oracle.mujoco.mj_kinematics(bodies, data)
        skeleton = hand.skeleton(angles[:, None])
        for number in range(15):
            body = data.body(CAPSULES[number])
            assert body.xmat.reshape(3, 3) == pytest.approx(skeleton.frames[number, :, :, 0], abs=1e-12)
            assert body.xpos * 1e3 == pytest.approx(skeleton.origins[number, :, 0], abs=1e-9)


def jaccard(one: np.ndarray, other: np.ndarray) -> float:
    """Return the switches ON in both over those ON in either."""
    return float((one & other).sum() / (one | other).sum())


def test_two_programs_agree_on_one_grasp_better_than_one_program_on_two(
    oracle: ModuleType, planned: dict[str, tuple[Condition, ...]]
) -> None:
    loads = [make_load(condition, n=2) for condition in planned["kamakura"]]
    ours, theirs = Quasistatic().solve(loads), [oracle.solve(load) for load in loads]
    assert np.concatenate([each.settled for each in theirs]).mean() > 0.9
    settled = [one.settled.all() and other.settled.all() for one, other in zip(ours, theirs, strict=True)]
    on, again = (
        np.array([each.forces_n > THRESHOLD_N for each, good in zip(found, settled, strict=True) if good])
        for found in (ours, theirs)
    )
    assert jaccard(on, again) > 0.6
    assert jaccard(on, again) > jaccard(on[:, 0], on[:, 1])
    bodies_n = [np.concatenate([each.capsules_n for each in found]).sum(axis=1).mean() for found in (ours, theirs)]
    assert bodies_n[0] == pytest.approx(bodies_n[1], rel=0.25)
