"""The switch of the largest information gain per cost at a node, exactly.

With f(n) = n ln n, n_vc rows of class c at value v, n_v, n_c and n their sums,

    n * gain = f(n) - sum over c of f(n_c) - sum over v of [ f(n_v) - sum over c of f(n_vc) ]

Counts and costs are whole numbers: gain a per cost p exceeds gain b per cost q where  a q - b p > 0, a sum of whole
multiples of f of whole numbers, whose sign `logsums` knows without doubt.
"""

from collections import Counter as Multiples

import numpy as np
from numpy.typing import NDArray

from .gain import Node
from .logsums import sign_of_f_sum

Counts = NDArray[np.int64]

# Of n ln n: how far apart two equal scores may come out, by far, with up to some thousand classes. What lies closer is
# compared exactly.
_CLOSE = 1e-12


def best_per_cost(node: Node, costs: Counts) -> int | None:
    """Return the number of the switch of largest gain / cost at `node`, None if none varies there.

    costs (d,), whole, > 0. Of equal switches the cheapest wins, then the lowest number.
    """
    sizes = node.cells.sum(axis=0)
    n = int(node.totals.sum())
    varying = np.flatnonzero((sizes > 0) & (sizes < n))
    if not len(varying):
        return None
    scores = _gains(node, varying) / costs[varying]
    slack = _CLOSE * n * float(np.log(n)) * (1.0 / costs[varying])
    close = varying[scores + slack >= (scores - slack).max()]
    return int(close[0]) if len(close) == 1 else _exact_best(node, close, costs)


def _gains(node: Node, columns: NDArray[np.intp]) -> NDArray[np.float64]:
    tables = node.tables(columns).astype(np.float64)
    totals = node.totals.astype(np.float64)
    whole = float(_f(totals.sum()) - _f(totals).sum())
    return np.asarray(whole + _f(tables).sum(axis=(1, 2)) - _f(tables.sum(axis=1)).sum(axis=1))


def _f(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(counts * np.log(np.maximum(counts, 1.0)))


def _exact_best(node: Node, close: NDArray[np.intp], costs: Counts) -> int:
    """Return the best of `close`; switches whose counts are alike gain alike, so one of them is compared."""
    first: dict[tuple[int, ...], tuple[int, Counts]] = {}
    for column in sorted(close.tolist(), key=lambda column: (int(costs[column]), column)):
        table = node.table(column)
        alike = (*sorted(table.ravel().tolist()), *sorted(table.sum(axis=0).tolist()))
        first.setdefault(alike, (column, table))
    (best, best_table), *others = first.values()
    for column, table in others:
        if _compare(table, int(costs[column]), best_table, int(costs[best])) > 0:
            best, best_table = column, table
    return best


def _compare(one: Counts, one_cost: int, other: Counts, other_cost: int) -> int:
    """Return the sign of gain(one) / one_cost - gain(other) / other_cost; tables (K, 2) of the same rows."""
    difference: Multiples[int] = Multiples()
    for table, times in ((one, other_cost), (other, -one_cost)):
        difference[int(table.sum())] += times
        for count in table.sum(axis=1).tolist() + table.sum(axis=0).tolist():
            difference[count] -= times
        for count in table.ravel().tolist():
            difference[count] += times
    return sign_of_f_sum(difference)
