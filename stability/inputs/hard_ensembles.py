"""Ensembles harder than trained ones: of thousands of rounds, with thresholds and answers of every size."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.boosting.stumps import Stumps

SWITCHES, JOINTS = 3, 2
_BESIDE = np.nextafter([7.0, 7.0, 0.0, 0.0, 65535.0], [0.0, 8.0, 1.0, -1.0, 0.0])  # one double from a code
CODES = np.array([*_BESIDE, 7.0, 7.5, 0.0, -0.5, 128.5, 65534.0, 65534.5, 65535.0, 1e300, -1e300])
BITS = np.array([*_BESIDE[2:4], -0.5, 0.0, 0.5, 1.0, 1e300, -1e300])


def ensembles(rng: np.random.Generator, n: int, rounds: int) -> Iterator[tuple[str, Stumps]]:
    """Yield n ensembles of each kind and up to 33 classes, over 3 switches and 2 joints; answers within 3."""
    for number in range(n):
        classes = int(rng.choice([2, 3, 5, 14, 33]))
        shape = rounds, classes, 3
        shrinkage = (1.0, 0.1, 1e-5)[number % 3]
        yield "answers of +-3", _stumps(rng, rng.choice([-3.0, 3.0], shape), shrinkage)
        yield (
            "answers of all sizes",
            _stumps(rng, rng.choice([-3.0, 3.0], shape) * 10.0 ** rng.uniform(-20, 0, shape), shrinkage),
        )
        yield (
            "one round again and again",
            _repeated(_stumps(rng, rng.uniform(-3, 3, (1, classes, 3)), shrinkage), rounds),
        )
        subnormal = np.ldexp(rng.integers(-9, 10, (20, classes, 3)).astype(np.float64), -1074)
        yield "answers next to nothing", _stumps(rng, subnormal, 1.0)


def frames(rng: np.random.Generator, n: int) -> tuple[NDArray[np.bool_], NDArray[np.uint16]]:
    """Return bits (n, 3) and codes (n, 2), those at thresholds among them."""
    codes = rng.choice([0, 1, 6, 7, 8, 128, 129, 65534, 65535], (n, JOINTS)).astype(np.uint16)
    return rng.random((n, SWITCHES)) < 0.5, codes


def _stumps(rng: np.random.Generator, values: NDArray[np.float64], shrinkage: float) -> Stumps:
    shape = values.shape[:2]
    columns = rng.integers(0, SWITCHES + JOINTS, shape)
    thresholds = np.where(columns < SWITCHES, rng.choice(BITS, shape), rng.choice(CODES, shape))
    return Stumps(SWITCHES + JOINTS, columns.astype(np.int32), thresholds, values, shrinkage)


def _repeated(once: Stumps, rounds: int) -> Stumps:
    columns, thresholds = once.columns.repeat(rounds, axis=0), once.thresholds.repeat(rounds, axis=0)
    return Stumps(once.n_inputs, columns, thresholds, once.values.repeat(rounds, axis=0), once.shrinkage)
