"""The made-up frontier, for all that shows one; small sets, for what computes one."""

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import own


@pytest.fixture(scope="session")
def examples() -> Any:
    """Return the module with example_frontier, which tests of other folders load too."""
    spec = importlib.util.spec_from_file_location("example_frontier", Path(__file__).with_name("example_frontier.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _make_set(seed: int = 0, rows: int = 96, switches: int = 14, joints: int = 3, subjects: int = 1) -> GraspSet:
    random = np.random.default_rng(seed)
    labels = np.arange(rows) % 4
    closed = np.random.default_rng(99).random((4, switches)) < 0.5
    centres = np.random.default_rng(98).integers(40, 200, (4, joints))
    return GraspSet(
        switches=closed[labels] ^ (random.random((rows, switches)) < 0.12),
        switch_names=tuple(f"s{number}" for number in range(switches)),
        codes=np.clip(centres[labels] + random.normal(0, 25, (rows, joints)), 0, 254).astype(np.uint16),
        joints=tuple(Joint(f"j{number}", "deg", 0, 0.0, 255, 127.5) for number in range(joints)),
        grasps=np.array(("cup", "pen", "plate", "rod"))[labels],
        taxonomy=own(["cup", "pen", "plate", "rod"]),
        subjects=np.array([f"S{row // 4 % subjects}" for row in range(rows)]),
        objects=np.full(rows, "thing"),
        trials=np.arange(rows),
    )


@pytest.fixture(scope="session")
def make_set() -> Callable[..., GraspSet]:
    """Return what makes a small set of grasps that can be learnt, with switches and joints."""
    return _make_set


@pytest.fixture(scope="session")
def grasp_set() -> GraspSet:
    return _make_set()
