"""The integer program that bounds how few pairs any m switches can leave alike, and names m that might."""

import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from ..samples import Columns

# The program is scaled so that a thousandth of all pairs is 1; HiGHS holds constraints to 1e-6 of that.
_UNIT, _SLACK = 1000.0, 1e-5
# Nodes of branch and bound for one program. What is cut off there still has a bound; a clock would not be repeatable.
_NODES = 1000


class Bounding:
    """Lines  alike(T) >= alike - sum over a in T of gains[a]  that hold for every T of m of the `varying` switches."""

    def __init__(self, varying: NDArray[np.intp], total: int, m: int) -> None:
        self._varying, self._total, self._m = varying, max(total, 1), m
        self._gains: list[NDArray[np.floating]] = []
        self._alike: list[float] = []

    def add(self, alike: int, gains: NDArray[np.int64]) -> None:
        """Take one line: of a set that leaves `alike` pairs, of which each switch (s,) tells gains[a] apart."""
        self._gains.append(gains[self._varying] * (_UNIT / self._total))
        self._alike.append(alike * (_UNIT / self._total))

    def solve(self) -> tuple[int, Columns]:
        """Return how many pairs are alike at least in any m switches, and m switches for which the lines allow least.

        The second is empty if none was found among the nodes that are looked at.
        """
        from scipy.optimize import Bounds, LinearConstraint, milp

        v = len(self._varying)
        lines = np.column_stack([np.array(self._gains), np.ones(len(self._gains))])
        size = np.append(np.ones(v), 0.0)
        with _silent():
            found = milp(
                np.append(np.zeros(v), 1.0),
                constraints=[
                    LinearConstraint(lines, lb=np.array(self._alike)),
                    LinearConstraint(size[np.newaxis], lb=self._m, ub=self._m),
                ],
                integrality=size,
                bounds=Bounds(0.0, np.append(np.ones(v), _UNIT)),
                options={"node_limit": _NODES, "mip_rel_gap": 0.0},
            )
        columns = () if found.x is None else tuple(self._varying[found.x[:v] > 0.5].tolist())
        bound = found.mip_dual_bound
        least = 0 if bound is None or not math.isfinite(bound) else math.ceil((bound - _SLACK) * self._total / _UNIT)
        return max(least, 0), columns


@contextmanager
def _silent() -> Iterator[None]:
    """Let nothing onto stdout: HiGHS writes there from C, now and then, whatever it is told."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "wb") as nothing:  # noqa: PTH123 - no path of ours
        os.dup2(nothing.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
