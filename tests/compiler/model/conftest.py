"""Random ensembles over switches and joints, harsher than trained ones: any threshold, any value; exact scores."""

from fractions import Fraction

import numpy as np

from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.tables import ScoreTables

# Every double is a whole multiple of it.
UNIT = Fraction(1, 2**1074)


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


def in_units(rows: np.ndarray) -> np.ndarray:
    """Return doubles as the whole multiples of UNIT that they are, as Python's integers."""
    wholes = [Fraction(each) / UNIT for each in rows.ravel().tolist()]
    assert all(each.denominator == 1 for each in wholes)
    return np.array([each.numerator for each in wholes], object).reshape(rows.shape)


def exact_scores(tables: ScoreTables, bits: np.ndarray, codes: np.ndarray) -> np.ndarray:
    """Return the scores of frames in units (n, k), by definition."""
    sums = np.tile(in_units(tables.bias), (len(bits), 1))
    for row, closed in zip(in_units(tables.switch_rows), bits.T, strict=True):
        sums[closed] += row
    for steps, rows, column in zip(tables.thresholds, tables.joint_rows, codes.T, strict=True):
        sums += in_units(np.asarray(rows))[(steps < column[:, np.newaxis]).sum(axis=1)]
    for pair in tables.grids:
        halves = zip(pair.joints, pair.thresholds, strict=True)
        a, b = ((steps < codes[:, [joint]]).sum(axis=1) for joint, steps in halves)
        sums += in_units(pair.rows)[a, b]
    for line in tables.lines:
        above = np.clip(codes[:, line.joint].astype(int), line.low, line.high) - line.low
        sums += above.astype(object)[:, np.newaxis] * in_units(line.row)
    return sums


def lost_in_parts(
    tables: ScoreTables, integers: IntegerTables, bits: np.ndarray, codes: np.ndarray
) -> tuple[np.ndarray, int]:
    """Return how far integers are below exact scores (n, k), in parts of a step, and how many parts a step has."""
    step = UNIT * Fraction(integers.scale)
    steps = integers.scores(bits, codes).astype(object)
    return step.numerator * exact_scores(tables, bits, codes) - step.denominator * steps, step.denominator
