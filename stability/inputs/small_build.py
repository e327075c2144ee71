"""A small glove's recordings, hard enough for rounding to matter, and the build that `thenar compile` makes of them."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.artifact.ensemble import ensemble_from_bytes
from thenar.compiler.artifact.select import select_inputs
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.tables.collapse import ScoreTables, collapse
from thenar.runtime.build import ENSEMBLE_NAME, Build

from .small_sets import make_set


class SmallBuild(NamedTuple):
    """A build, the score tables it was quantised from, and the kept switches (n, s) and codes (n, j) trained on."""

    build: Build
    tables: ScoreTables
    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]


def small_set(seed: int, rows: int, switches: int, joints: int, types: int, noise: float) -> GraspSet:
    """Return recordings in which a share `noise` of the switches' bits is flipped and joints overlap as much."""
    ideal = np.random.default_rng(99)
    closed, centres = ideal.random((types, switches)) < 0.5, ideal.integers(40, 216, (types, joints))
    random, labels = np.random.default_rng(seed), np.arange(rows) % types
    codes = centres[labels] + np.rint(random.normal(0, 250 * noise, (rows, joints)))
    names = [f"grasp {number}" for number in range(types)]
    bits = closed[labels] ^ (random.random((rows, switches)) < noise)
    return make_set([names[label] for label in labels], bits.tolist(), codes.clip(0, 255).tolist(), types=names)


def small_build(grasps: GraspSet, rounds: int, prune: int = 0) -> SmallBuild:
    """Return the build of `grasps`, compiled into a folder and loaded from it."""
    with TemporaryDirectory() as folder:
        where = compile_build(grasps, Path(folder) / "build", rounds=rounds, prune=prune, folds=0).folder
        build = Build.load(where)
        stumps = ensemble_from_bytes((where / ENSEMBLE_NAME).read_bytes())
    bits, codes = select_inputs(grasps, build.manifest)
    return SmallBuild(build, collapse(stumps, bits.shape[1]), bits, codes)
