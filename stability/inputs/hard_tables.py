"""Score tables as lists, their largest sums, and all possible frames of small ones."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import HIGHEST_CODE

Bits = NDArray[np.bool_]
Codes = NDArray[np.uint16]


def listed(tables: ScoreTables | IntegerTables) -> tuple[Any, Any, Any, Any]:
    """Return the bias, switch rows, thresholds and joint rows as lists."""
    many = ([part.tolist() for part in parts] for parts in (tables.thresholds, tables.joint_rows))
    return tables.bias.tolist(), tables.switch_rows.tolist(), *many


def rows_of(tables: ScoreTables | IntegerTables) -> list[list[list[float]]]:
    """Return the rows (K,) of bias, switches and joints, input by input; a switch has the row for closed."""
    bias, switch_rows, _, joint_rows = listed(tables)
    return [[bias], *([row] for row in switch_rows), *joint_rows]


def largest_sum(inputs: Iterable[Sequence[Sequence[float]]]) -> float:
    """Return the largest magnitude of a class's sum of rows (K,), at most one per input, in any order of summation.

    It therefore also bounds all partial sums.
    """
    reached = 0.0
    for sign in (1, -1):
        tops = [[max(0, *(sign * step for step in column)) for column in zip(*rows, strict=True)] for rows in inputs]
        reached = max(reached, *(sum(column) for column in zip(*tops, strict=True)))
    return reached


def every_frame(tables: ScoreTables | IntegerTables) -> Iterator[tuple[tuple[bool, ...], tuple[int, ...]]]:
    """Yield bits and codes for every combination of open and closed switches, and lowest and highest codes of bins."""
    ends = []
    for thresholds in tables.thresholds:
        below = [int(code) for code in thresholds]
        ends.append(sorted({0, *below, *(code + 1 for code in below if code < HIGHEST_CODE), HIGHEST_CODE}))
    yield from product(product((False, True), repeat=len(tables.switch_rows)), product(*ends))
