"""Score tables that are hard to quantise, and all possible frames of small ones."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import HIGHEST_CODE, Floats

Bits = NDArray[np.bool_]
Codes = NDArray[np.uint16]


class Frame(NamedTuple):
    """Bits (s,) and codes (j,) that represent all frames with the same scores."""

    bits: tuple[bool, ...]
    codes: tuple[int, ...]


class Quantised(NamedTuple):
    """Score tables and the integers that the compiler derives from them."""

    name: str
    tables: ScoreTables
    integers: IntegerTables


def drawn(seed: int, classes: int, switches: int, bins: tuple[int, ...], decades: float = 1.0) -> ScoreTables:
    """Return tables of normal deviates, with rows up to `decades` powers of ten larger or smaller; `bins` per joint."""
    random = np.random.default_rng(seed)

    def rows(n: int) -> Floats:
        size = 10.0 ** np.rint(random.uniform(-decades, decades, (n, 1)))
        drawn: Floats = random.normal(0, 1, (n, classes)) * size
        return drawn

    thresholds = [np.sort(random.choice(255, n - 1, replace=False)).astype(np.uint16) for n in bins]
    return ScoreTables.of(rows(1)[0], rows(switches), tuple(thresholds), tuple(rows(n) for n in bins))


def dominated(seed: int, classes: int, switches: int, bins: tuple[int, ...], factor: float) -> ScoreTables:
    """Return tables in which every row of the last class is `factor` times as large as those of the others."""
    sizes = np.ones(classes)
    sizes[-1] = factor
    return sized(drawn(seed, classes, switches, bins), sizes)


def sized(tables: ScoreTables, sizes: float | Floats) -> ScoreTables:
    """Return tables with every row multiplied by `sizes`, a number or one per class (K,)."""
    rows = tuple(rows * sizes for rows in tables.joint_rows)
    return ScoreTables.of(tables.bias * sizes, tables.switch_rows * sizes, tables.thresholds, rows)


def half_a_step_off(switches: int, limit: int) -> ScoreTables:
    """Return tables of two classes whose finest scale is 1, where bias and all rows lie half way between two steps.

    Those of class 0 lie above an even step, those of class 1 below one: rounded half to even, one loses half a step in
    each row, the other gains it. A scale above 1 would round class 0 up in each row and exceed `limit`, which must be
    at least 2 for every switch and the bias.
    """
    even = 2 * (limit // 2 // switches)
    first = np.full(switches, float(even))
    first[0] += limit - limit % 2 - even * switches
    rows = np.stack([first + 0.5, np.full(switches, 1.5)], axis=1)
    return ScoreTables.of(np.array([0.5, 1.5]), rows, (), ())


def whole_numbers(seed: int, classes: int, switches: int, bins: tuple[int, ...], most: int) -> IntegerTables:
    """Return integer tables of random numbers up to `most`, in which a mean may lie outside its rows."""
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> NDArray[np.int16]:
        return random.integers(-most, most + 1, shape).astype(np.int16)

    thresholds = [np.sort(random.choice(HIGHEST_CODE, n - 1, replace=False)).astype(np.uint16) for n in bins]
    joints = tuple(rows(n, classes) for n in bins)
    means = rows(switches, classes), rows(len(bins), classes)
    return IntegerTables.of(rows(classes), rows(switches, classes), tuple(thresholds), joints, *means, 1.0)


def quantised(name: str, tables: ScoreTables, width: int = 16, seed: int = 0) -> Quantised:
    """Return `tables` quantised by the compiler, with 50 random training rows."""
    random = np.random.default_rng(seed)
    bits = random.random((50, len(tables.switch_rows))) < 0.5
    codes = random.integers(0, 256, (50, len(tables.thresholds))).astype(np.uint16)
    return Quantised(name, tables, quantise(tables, bits, codes, width))


def rows_of(tables: ScoreTables | IntegerTables) -> list[list[list[float]]]:
    """Return the rows (K,) of bias, switches and joints, input by input; a switch has the row for closed."""
    inputs = [[tables.bias.tolist()], *([row] for row in tables.switch_rows.tolist())]
    return [*inputs, *(rows.tolist() for rows in tables.joint_rows)]


def largest_sum(inputs: Iterable[Sequence[Sequence[float]]]) -> float:
    """Return the largest magnitude of a class's sum of rows (K,), at most one per input, in any order of summation.

    It therefore also bounds all partial sums.
    """
    reached = 0.0
    for sign in (1, -1):
        tops = [[max(0, *(sign * step for step in column)) for column in zip(*rows, strict=True)] for rows in inputs]
        reached = max(reached, *(sum(column) for column in zip(*tops, strict=True)))
    return reached


def first_best(scores: Sequence[int]) -> int:
    """Return the index of the greatest score, of equal ones the first, written as in C."""
    best = 0
    for k in range(1, len(scores)):
        if scores[k] > scores[best]:
            best = k
    return best


def every_frame(tables: ScoreTables | IntegerTables) -> Iterator[Frame]:
    """Yield a frame for every combination of open and closed switches, and of the lowest and highest codes of bins."""
    bits = product((False, True), repeat=len(tables.switch_rows))
    ends = [ends_of_bins(thresholds) for thresholds in tables.thresholds]
    for switches, codes in product(bits, product(*ends)):
        yield Frame(switches, codes)


def ends_of_bins(thresholds: Codes) -> list[int]:
    """Return the lowest and the highest code of every bin of a joint with thresholds (T,)."""
    below = [int(code) for code in thresholds]
    return sorted({0, *below, *(code + 1 for code in below if code < HIGHEST_CODE), HIGHEST_CODE})
