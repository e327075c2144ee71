"""The additive logit with pairs of joints, which model interactions that tables of single inputs cannot.

The logit is fitted without pairs first. Then, for each pair of joints, cut into few bins, the possible gain of its
cells is estimated: the residuals of a class in a cell sum to G, their variances to H, and the sum of G^2 / H is twice
the gain of one Newton step in each cell (as FAST ranks pairs for interpretml's EBM, Lou, Caruana, Gehrke and Hooker
2013, which uses splits into four). The best pair is taken, then the best of the remaining joints, so no joint is in two
pairs and the contribution of a pair depends on no other input. Then all tables are fitted at once, with the differences
between neighbouring cells, in both directions, pulled towards zero: again a convex function.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import Floats
from thenar.runtime.model.terms.grid import Grid

from ..boosting.boost import BoostingError, check_rows
from ..boosting.exactsums import exact_sum, on_one_grid
from ..workers import check_memory
from .logit import TOLERANCE, Column, Fit, column_edges, columns_of, count_of, sparse, spread_out, tables_of

PAIRS, PAIR_BINS, PAIR_SMOOTHNESS = 4, 8, 0.5
MOST_PAIR_BINS = 16  # 256 cells are the rows of one lookup


def fit_pairs(
    switches: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    labels: NDArray[np.intp],
    n_classes: int,
    *,
    penalty: float,
    smoothness: float,
    max_bins: int | None,
    pairs: int = PAIRS,
    pair_bins: int = PAIR_BINS,
    pair_smoothness: float = PAIR_SMOOTHNESS,
    tolerance: float = TOLERANCE,
    counted: int = 0,
    held: NDArray[np.bool_] | None = None,
) -> ScoreTables:
    """Fit switches (n, s), codes (n, j) and labels (n,) in 0..n_classes-1, with at most `pairs` pairs of joints.

    `pair_smoothness` pulls neighbouring cells of a pair towards each other; joints have at most `pair_bins` bins in a
    pair. The other parameters are those of `fit_logit`. Raises BoostingError.
    """
    if not 2 <= pair_bins <= MOST_PAIR_BINS:
        raise BoostingError(f"pair_bins={pair_bins} must be 2 to {MOST_PAIR_BINS}: a pair is one lookup of bytes")
    X, s = np.hstack([switches, codes]), switches.shape[1]
    if not (0 < penalty < np.inf and 0 <= smoothness < np.inf and 0 <= pair_smoothness < np.inf):
        raise BoostingError(f"penalty={penalty} must be above 0, and smoothness at least 0, all finite")
    check_rows(X, labels, n_classes, None)
    check_memory(len(X), n_classes, BoostingError, *X.shape[1:])
    columns = columns_of(X, max_bins, None, None)
    count = count_of(columns[:counted], np.ones(len(X)))
    alone = Fit([*columns, *count], labels, n_classes, penalty, smoothness, None, held)
    rows = alone.minimum(tolerance)
    edges = column_edges(codes, pair_bins)
    found = _ranked(edges, codes, alone.residuals(rows), pairs)
    if found:
        made = [_cells(edges, codes, pair, pair_smoothness) for pair in found]
        rows = Fit([*columns, *count, *made], labels, n_classes, penalty, smoothness, None, held).minimum(
            tolerance, rows
        )
    own = 1 + sum(column.n_rows for column in (*columns, *count))
    tables = tables_of(columns, spread_out(columns, rows[:own], count), np.ones(len(X))).score_tables(s)
    blocks = np.split(rows[own:], np.cumsum([column.n_rows for column in made])[:-1]) if found else []
    grids = []
    for (a, b), block in sorted(zip(found, blocks, strict=True), key=lambda each: each[0]):
        one, other = (np.floor(edges[joint]).astype(np.uint16) for joint in (a, b))
        grids.append(Grid((a, b), (one, other), block.reshape(len(one) + 1, len(other) + 1, n_classes)))
    return ScoreTables(tables.bias, (*tables.terms, *grids))


def _bins(edges: Sequence[Floats], codes: NDArray[np.uint16], joint: int) -> NDArray[np.intp]:
    bins: NDArray[np.intp] = np.searchsorted(edges[joint], codes[:, joint])
    return bins


def _cells(edges: Sequence[Floats], codes: NDArray[np.uint16], pair: tuple[int, int], smoothness: float) -> Column:
    one, other = (_bins(edges, codes, joint) for joint in pair)
    shape = len(edges[pair[0]]) + 1, len(edges[pair[1]]) + 1
    return Column(np.zeros(0), one * shape[1] + other, 0, cells=shape, smoothness=smoothness)


def _ranked(
    edges: Sequence[Floats], codes: NDArray[np.uint16], residuals: tuple[Floats, Floats], most: int
) -> list[tuple[int, int]]:
    """Return the pairs of joints with the largest gain, at most `most`, no joint twice; ties go to the first."""
    n, gains = len(codes), []
    over, spread = (on_one_grid(each, n) for each in residuals)
    bins = {joint: _bins(edges, codes, joint) for joint in range(codes.shape[1]) if len(edges[joint])}
    for a, b in combinations(bins, 2):
        cells = bins[a] * (len(edges[b]) + 1) + bins[b]
        members = sparse(np.ones(n), cells, np.arange(n), (int(cells.max()) + 1, n))
        sums, spreads = members @ over, members @ spread
        gains.append((exact_sum(sums * sums / (spreads + 1.0)), a, b))
    found: list[tuple[int, int]] = []
    for _, a, b in sorted(gains, key=lambda gain: (-gain[0], *gain[1:])):
        if len(found) < most and not any({a, b} & set(pair) for pair in found):
            found.append((a, b))
    return found
