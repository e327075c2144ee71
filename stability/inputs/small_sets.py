"""Small sets of grasps: rows given one by one, an XOR, recordings of a small glove, and its build."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.artifact.ensemble import ensemble_from_bytes
from thenar.compiler.model.collapse import collapse
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import own
from thenar.compiler.samples import select_inputs
from thenar.runtime.build import ENSEMBLE_NAME, Build
from thenar.runtime.model.tables import ScoreTables


def make_set(
    grasps: Sequence[str],
    switches: Sequence[Sequence[int]] = (),
    codes: Sequence[Sequence[int]] = (),
    subjects: Sequence[str] = (),
    types: Sequence[str] = (),
) -> GraspSet:
    """Return the set of these rows: switches (n, s) of 0 and 1, codes (n, j); without `subjects` all are A's.

    `types` may include grasp types without rows. Trials are numbered from 0.
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


def parity(inputs: int) -> GraspSet:
    """Return every frame of `inputs` switches, of type odd or even by the number of closed ones: their XOR."""
    frames = [[number >> bit & 1 for bit in range(inputs)] for number in range(1 << inputs)]
    return make_set(["odd" if sum(frame) % 2 else "even" for frame in frames], frames)


class SmallBuild(NamedTuple):
    """A build, the score tables it was quantised from, and its training rows: kept switches (n, s), codes (n, j),
    classes (n,).
    """

    build: Build
    tables: ScoreTables
    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    labels: NDArray[np.intp]


def small_set(seed: int, rows: int, switches: int, joints: int, types: int, noise: float) -> GraspSet:
    """Return recordings in which a share `noise` of the switches' bits is flipped, with overlapping joints."""
    ideal = np.random.default_rng(99)
    closed, centres = ideal.random((types, switches)) < 0.5, ideal.integers(40, 216, (types, joints))
    random, labels = np.random.default_rng(seed), np.arange(rows) % types
    codes = centres[labels] + np.rint(random.normal(0, 250 * noise, (rows, joints)))
    names = [f"grasp {number}" for number in range(types)]
    bits = closed[labels] ^ (random.random((rows, switches)) < noise)
    return make_set([names[label] for label in labels], bits.tolist(), codes.clip(0, 255).tolist(), types=names)


def small_build(grasps: GraspSet, rounds: int) -> SmallBuild:
    """Return the build of `grasps`, compiled into a folder and loaded from it."""
    with TemporaryDirectory() as folder:
        where = compile_build(grasps, Path(folder) / "build", rounds=rounds, prune=0, folds=0, refuse=0).folder
        build = Build.load(where)
        stumps = ensemble_from_bytes((where / ENSEMBLE_NAME).read_bytes())
    bits, codes = select_inputs(grasps, build.manifest)
    labels = np.unique(grasps.labels, return_inverse=True)[1]
    return SmallBuild(build, collapse(stumps, bits.shape[1]), bits, codes, labels)
