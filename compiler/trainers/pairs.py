"""The additive logit with pairs of joints, which model interactions that tables of single inputs cannot.

The logit is fitted without pairs first. Then, for each pair of joints, cut into few bins, the possible gain of its
cells is estimated: the residuals of a class in a cell sum to G, their variances to H, and the sum of G^2 / H is twice
the gain of one Newton step in each cell (as FAST ranks pairs for interpretml's EBM, Lou, Caruana, Gehrke and Hooker
2013, which uses splits into four). The best pair is taken, then the best of the remaining joints, so no joint is in two
pairs and the contribution of a pair depends on no other input. Then all tables are fitted at once, with the differences
between neighbouring cells, in both directions, pulled towards zero: again a convex function.
"""

from collections.abc import Mapping
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.grid import Grid

from ..elementary import Floats, exact_sum, on_one_grid
from ..samples import TrainingError
from ..workers import check_memory
from .base import Report, Setting, Trainer, check_rows
from .binning import BinnedColumn, bin_columns
from .logit import BINS, count_of, of_none, spread_out, tables_of
from .logit import MEMBER as LOGIT
from .newton import DRAFT, TOLERANCE, Column, Fit, columns_of, sparse

if TYPE_CHECKING:
    from ..samples import Samples

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
    pair. The other parameters are those of `fit_logit`. Raises TrainingError.
    """
    if not 2 <= pair_bins <= MOST_PAIR_BINS:
        raise TrainingError(f"pair_bins={pair_bins} must be 2 to {MOST_PAIR_BINS}: a pair is one lookup of bytes")
    X, s = np.hstack([switches, codes]), switches.shape[1]
    if not (0 < penalty < np.inf and 0 <= smoothness < np.inf and 0 <= pair_smoothness < np.inf):
        raise TrainingError(f"penalty={penalty} must be above 0, and smoothness at least 0, all finite")
    check_rows(X, labels, n_classes, None)
    check_memory(len(X), n_classes, TrainingError, *X.shape[1:])
    columns = columns_of(X, max_bins)
    count = count_of(columns[:counted])
    alone = Fit([*columns, *count], labels, n_classes, penalty, smoothness, held)
    rows = alone.minimum(tolerance)
    binned = bin_columns(codes, pair_bins).columns
    found = _ranked(binned, alone.residuals(rows), pairs)
    if found:
        made = []
        for first, second in ((binned[a], binned[b]) for a, b in found):
            shape = len(first.edges) + 1, len(second.edges) + 1
            made.append(Column(np.zeros(0), _cells(first, second), 0, cells=shape, smoothness=pair_smoothness))
        every = [*columns, *count, *made]
        rows = Fit(every, labels, n_classes, penalty, smoothness, held).minimum(tolerance, rows)
    own = 1 + sum(column.n_rows for column in (*columns, *count))
    tables = tables_of(columns, spread_out(columns, rows[:own], count)).score_tables(s)
    blocks = np.split(rows[own:], np.cumsum([column.n_rows for column in made])[:-1]) if found else []
    grids = []
    for (a, b), block in sorted(zip(found, blocks, strict=True), key=lambda each: each[0]):
        one, other = (np.floor(binned[joint].edges).astype(np.uint16) for joint in (a, b))
        grids.append(Grid((a, b), (one, other), block.reshape(len(one) + 1, len(other) + 1, n_classes)))
    return ScoreTables(tables.bias, (*tables.terms, *grids))


def _cells(one: BinnedColumn, other: BinnedColumn) -> NDArray[np.intp]:
    """Return the cell (n,) of each frame in the grid of two joints' bins, numbered row by row."""
    cells: NDArray[np.intp] = one.bins.astype(np.intp) * (len(other.edges) + 1) + other.bins
    return cells


def _ranked(binned: Mapping[int, BinnedColumn], residuals: tuple[Floats, Floats], most: int) -> list[tuple[int, int]]:
    """Return the pairs of joints with the largest gain, at most `most`, no joint twice; ties go to the first."""
    n, gains = len(residuals[0]), []
    over, spread = (on_one_grid(each, n) for each in residuals)
    for a, b in combinations(sorted(binned), 2):
        cells = _cells(binned[a], binned[b])
        members = sparse(np.ones(n), cells, np.arange(n), (int(cells.max()) + 1, n))
        sums, spreads = members @ over, members @ spread
        gains.append((exact_sum(sums * sums / (spreads + 1.0)), a, b))
    found: list[tuple[int, int]] = []
    for _, a, b in sorted(gains, key=lambda gain: (-gain[0], *gain[1:])):
        if len(found) < most and not any({a, b} & set(pair) for pair in found):
            found.append((a, b))
    return found


class Pairs(Trainer):
    """The logit with interactions of pairs of joints, chosen by their gain."""

    name = "pairs"
    what = "the logit, with tables for pairs of joints"
    rank = 2
    settings = (
        *LOGIT.settings,
        Setting("pairs", "Use at most this many pairs of joints; each joint is in one pair at most.", int, PAIRS, 1),
        Setting("pair_bins", "Give a joint at most this many bins in a pair.", int, PAIR_BINS, 2, MOST_PAIR_BINS),
        Setting(
            "pair_smoothness",
            "Pull of a pair's neighbouring bins towards each other.",
            float,
            PAIR_SMOOTHNESS,
            0.0,
            1e6,
        ),
    )
    drafting = DRAFT
    tried = ({"penalty": 0.3, "smoothness": 2.0, "max_bins": 32, "pair_smoothness": 0.3},)

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> ScoreTables:
        """Return the tables. Raises TrainingError for settings that make no sense."""
        given = {**settings, "max_bins": settings["max_bins"] or BINS}
        return fit_pairs(
            samples.switches, samples.codes, samples.labels, samples.n_classes, **given, **of_none(samples)
        )


MEMBER = Pairs()
