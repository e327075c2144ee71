"""Random integer tables with slopes, and the shapes that firmware of them is tried in."""

import numpy as np

from thenar.runtime.tables import COARSE, IntegerTables, Slope

# Classes, switches, joints, of which the first so many have bins and the last so many slopes; whether codes are wide,
# and rows multiples of 256.
SHAPES = {
    "slopes alone": (14, 0, 3, 0, 3, False, False),
    "one slope": (2, 0, 1, 0, 1, False, False),
    "switches": (5, 7, 2, 0, 2, False, False),
    "switches, upper halves": (14, 13, 4, 0, 4, False, True),
    "bins and slopes": (7, 6, 4, 2, 3, False, False),
    "bins and slopes, upper halves": (6, 6, 4, 3, 3, False, True),
    "wide codes": (4, 5, 3, 2, 2, True, False),
    "wide codes, upper halves": (3, 5, 3, 2, 2, True, True),
    "parts": (17, 5, 3, 1, 3, False, False),
    "parts, upper halves": (31, 5, 3, 2, 2, True, True),
    "slopes alone in parts": (16, 0, 2, 0, 2, True, False),
}


def sloped(
    seed: int, classes: int, switches: int, joints: int, binned: int, slopes: int, wide: bool, coarse: bool
) -> IntegerTables:
    """Return tables of that shape: rows of bins small enough for bytes, or multiples of 256."""
    random = np.random.default_rng(seed)
    top, unit = 60_000 if wide else 255, COARSE if coarse else 1

    def rows(*shape: int) -> np.ndarray:
        return (unit * random.integers(-20 // (1 + 9 * coarse), 21 // (1 + 9 * coarse), shape)).astype(np.int16)

    def thresholds(joint: int) -> np.ndarray:
        first = int(random.integers(1, top - 200)) if top > 255 else 0
        return np.sort(random.choice(200, 4 if joint < binned else 0, replace=False) + first).astype(np.uint16)

    steps = tuple(thresholds(joint) for joint in range(joints))
    return IntegerTables(
        bias=random.integers(-99, 100, classes).astype(np.int16),
        switch_rows=rows(switches, classes),
        thresholds=steps,
        joint_rows=tuple(rows(len(each) + 1, classes) for each in steps),
        switch_means=rows(switches, classes),
        joint_means=rows(joints, classes),
        scale=100.0,
        slopes=tuple(_slope(random, joint, classes, top, slopes) for joint in range(joints - slopes, joints)),
    )


def _slope(random: np.random.Generator, joint: int, classes: int, top: int, slopes: int) -> Slope:
    span = int(random.choice([1, 5, 100, 254, 255, min(top, 3000)]))
    low = int(random.choice([0, random.integers(0, top - span + 1), top - span]))
    gain = next(gain for gain in range(0, -17, -1) if span >> -gain <= 254)
    while gain >= 0 and gain < 3 and span << gain + 1 <= 254:
        gain += 1
    row = random.integers(-128, 128, classes) // slopes
    row[random.random(classes) < 0.2] = 0
    return Slope(joint, low, low + span, gain, row.astype(np.int8))
