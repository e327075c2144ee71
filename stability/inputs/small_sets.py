"""Small sets of grasps, made of plain lists: rows given one by one, one-hot types, an XOR."""

from collections.abc import Sequence

import numpy as np

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import own


def make_set(
    grasps: Sequence[str],
    switches: Sequence[Sequence[int]] = (),
    codes: Sequence[Sequence[int]] = (),
    subjects: Sequence[str] = (),
    types: Sequence[str] = (),
) -> GraspSet:
    """Return the set of these rows: switches (n, s) of 0 and 1, codes (n, j); without `subjects` all are A's.

    `types` may name grasp types that no row has. Trials are numbered from 0.
    """
    rows = len(grasps)
    bits = np.array(switches, bool).reshape(rows, -1 if switches else 0)
    joints = np.array(codes, np.uint16).reshape(rows, -1 if codes else 0)
    return GraspSet(
        switches=bits,
        switch_names=tuple(f"s{number}" for number in range(bits.shape[1])),
        codes=joints,
        joints=tuple(Joint(f"j{number}", "deg", 0, 0.0, 255, 127.5) for number in range(joints.shape[1])),
        grasps=np.array(grasps, np.str_),
        taxonomy=own(types or sorted(set(grasps))),
        subjects=np.array(subjects or ["A"] * rows, np.str_),
        objects=np.full(rows, "thing"),
        trials=np.arange(rows),
    )


def one_hot(rows: int) -> GraspSet:
    """Return as many grasp types as rows: each closes one switch of its own."""
    return make_set([f"type {row:02}" for row in range(rows)], np.eye(rows, dtype=int).tolist())


def parity(inputs: int) -> GraspSet:
    """Return every frame of that many switches, of type odd or even by the number that is closed: their XOR."""
    frames = [[number >> bit & 1 for bit in range(inputs)] for number in range(1 << inputs)]
    return make_set(["odd" if sum(frame) % 2 else "even" for frame in frames], frames)
