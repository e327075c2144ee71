"""Rows that resemble grasps, for benchmarks: seeded, of any number, and harder to separate than random ones."""

import numpy as np
from numpy.typing import NDArray

CLASSES, JOINTS, FLIP = 14, 16, 0.1


def grasp_like(
    rows: int, seed: int, switches: int = 160
) -> tuple[NDArray[np.bool_], NDArray[np.uint16], NDArray[np.intp]]:
    """Return bits (rows, switches), codes (rows, joints) of half degrees, labels (rows,): classes in equal shares.

    A grasp type is a pattern with a quarter of the switches ON, of which FLIP of the bits are wrong in every row, and
    a posture with a spread of 10 degrees.
    """
    rng = np.random.default_rng(seed)
    patterns = rng.random((CLASSES, switches)) < 0.25
    postures = rng.uniform(40, 200, size=(CLASSES, JOINTS))
    labels = np.arange(rows) % CLASSES
    bits = patterns[labels]
    for start in range(0, rows, 1 << 16):  # in blocks: a million rows of doubles would be a gigabyte
        block = bits[start : start + (1 << 16)]
        block ^= rng.random(block.shape, dtype=np.float32) < FLIP
    codes = np.rint(postures[labels] + rng.normal(0, 20, size=(rows, JOINTS))).clip(0, 359).astype(np.uint16)
    return bits, codes, labels
