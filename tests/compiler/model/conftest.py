"""Random ensembles over switches and joints, harsher than trained ones: any threshold, any value."""

import numpy as np

from thenar.compiler.trainers.stumps import Stumps


def make_stumps(
    seed: int = 0, rounds: int = 20, classes: int = 4, switches: int = 6, joints: int = 3, shrinkage: float = 1.0
) -> Stumps:
    random = np.random.default_rng(seed)
    columns = random.integers(0, switches + joints, (rounds, classes)).astype(np.int32)
    between_codes = random.integers(-3, 259, columns.shape) + random.choice([0.0, 0.5], columns.shape)
    far = random.choice([0.0, -1e300, 65534.5, 65535.0, 1e300], columns.shape, p=[0.8, 0.05, 0.05, 0.05, 0.05])
    thresholds = np.where(columns < switches, random.choice([-0.5, 0.0, 0.5, 1.0], columns.shape), between_codes + far)
    values = random.normal(0, 2, (*columns.shape, 3))
    return Stumps(switches + joints, columns, thresholds, values, shrinkage)


def make_rows(seed: int = 0, n: int = 40, switches: int = 6, joints: int = 3) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    codes = random.integers(0, 259, (n, joints)).astype(np.uint16)
    codes[random.random(codes.shape) < 0.1] = 65535
    return random.random((n, switches)) < 0.5, codes
