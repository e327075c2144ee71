"""Small sets of grasps that can be learnt, with switches and joints."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler.hand import HandShape
from thenar.compiler.recordings.graspset import GraspSet
from thenar.simulator.handmaps.handmap import hand_map

from ..sets import grasp_set_of


def make_set(
    seed: int = 0,
    rows: int = 96,
    switches: int = 14,
    joints: int = 3,
    types: int = 4,
    subjects: int = 1,
    frames: int = 1,
) -> GraspSet:
    """Return `rows` trials, each of so many equal frames."""
    random = np.random.default_rng(seed)
    labels = np.arange(rows) % types
    closed = np.random.default_rng(99).random((types, switches)) < 0.5
    centres = np.random.default_rng(98).integers(40, 200, (types, joints))
    names = ("cup", "pen", "plate", "rod", "ball", "key", *(f"g{number}" for number in range(6, types)))[:types]
    grasp_set = grasp_set_of(
        [*names, "never seen"],
        labels,
        switches=closed[labels] ^ (random.random((rows, switches)) < 0.12),
        codes=np.clip(centres[labels] + random.normal(0, 25, (rows, joints)), 0, 254),
        subjects=np.array([f"S{row // types % subjects}" for row in range(rows)]),
    )
    return grasp_set if frames == 1 else grasp_set.rows(np.repeat(np.arange(rows), frames))


def content(folder: Path) -> dict[str, str]:
    """Return the texts of all files of a folder by their paths in it."""
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def names_of(count: int) -> list[str]:
    """Return so many names of switches."""
    return [f"s{number}" for number in range(count)]


@pytest.fixture(scope="session")
def hand() -> HandShape:
    shape = hand_map().fitted(hand_map().names)
    assert shape is not None
    return shape


@pytest.fixture(scope="session")
def grasp_set() -> GraspSet:
    return make_set()


def grasps(seed: int, n: int = 60, bits: int = 6, joints: int = 2, classes: int = 3) -> tuple[Any, Any]:
    """Return rows of bits and of joints' codes, and their labels, which both tell with some noise."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, classes, size=n)
    prototypes = rng.random((classes, bits)) < 0.4
    switches = prototypes[labels] ^ (rng.random((n, bits)) < 0.15)
    codes = rng.integers(1, 256, size=(n, joints)) // 3 + labels[:, None] * 9
    return np.column_stack([switches, codes]).astype(np.int64), labels.astype(np.intp)


def with_none(grasp_set: GraspSet) -> GraspSet:
    """Return the rows with others among them in which nothing is held, of the same trials and with other readings."""
    rows = np.sort(np.concatenate([np.arange(len(grasp_set)), np.arange(0, len(grasp_set), 3)]))
    more, nothing = grasp_set.rows(rows), np.diff(rows, prepend=-1) == 0
    return replace(
        more,
        switches=more.switches & ~nothing[:, np.newaxis],
        codes=np.where(nothing[:, np.newaxis], 1, more.codes).astype(np.uint16),
        grasps=np.where(nothing, "none", more.grasps),
        times_us=10_000 * np.arange(len(rows)),
    )
