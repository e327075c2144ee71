"""The additive logit on hard problems: separable classes, copied columns, extreme penalties, many equal rows."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.compiler.trainers.logit import BINS, ColumnTables, fit_logit
from thenar.compiler.trainers.newton import BIAS_SHARE, BIN_SHARE, TOLERANCE
from thenar.compiler.trainers.pairs import fit_pairs
from thenar.runtime.model.integers import LIMIT
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.tables import ScoreTables

from ..checks.rounds import ROUNDING
from ..finding import REFERENCE, Finding
from ..inputs.hard_data import HardSet, contradictory, intervals, noisy, separable, words
from ..inputs.hard_tables import largest_sum, rows_of
from ..reference.logit import ReferenceColumn, largest_derivative
from ..reference.numbers import precisely

# Penalties on scores, and on differences of neighbouring bins.
USUAL, TINY, HUGE = (1.0, 3.0), (1e-6, 0.0), (1e6, 1e6)


def findings(full: bool) -> Iterator[Finding]:
    """Yield the distance of each solution from the minimum, and the invariances."""
    at_rest = Finding.of("largest derivative at the solution", REFERENCE, 1.0, "x tolerance and rounding")
    large = Finding.of("entries beyond the limit of the penalty, or not finite", "the loss of zeros", 0.0, "sets")
    overflow = Finding.of("largest sum of the integer tables, any order", "all rows' extremes", LIMIT, "steps")
    wrong = Finding.of("frames predicted wrongly by tables and integers", "their labels", 0.0, "frames")
    changed = Finding.of("solutions changed by the order of rows or a constant column", "itself", 0.0, "solutions")
    for hard, pulls, is_separable in _fits(full):
        at = f"{hard.name}, penalty {pulls[0]:g}"
        tables = _fit(hard, pulls)
        at_rest.see(_unrest(hard, tables, pulls), at)
        bound = math.sqrt(2 * len(hard.X) * math.log(hard.n_classes) / (pulls[0] * BIAS_SHARE))
        large.see(float(not all((np.abs(rows) <= bound).all() for rows in (tables.bias, *tables.rows))), at)
        integers = quantise(tables.score_tables(hard.n_switches), hard.bits, hard.codes)
        overflow.see(largest_sum(rows_of(integers)), at)
        if is_separable:
            both = (model.scores(hard.bits, hard.codes) for model in (tables.score_tables(hard.n_switches), integers))
            errors = sum(np.count_nonzero(scores.argmax(axis=1) != hard.labels) for scores in both)
            wrong.see(float(errors), at, len(hard.X))
        order = np.random.default_rng(1).permutation(len(hard.X))
        again = _fit(replace(hard, X=np.column_stack([hard.X, np.full(len(hard.X), 7)])).rows(order), pulls)
        same = all(map(np.array_equal, (tables.bias, *tables.rows), (again.bias, *again.rows[:-1])))
        changed.see(float(not same or again.rows[-1].any()), at)
    yield from (at_rest, large, overflow, wrong, changed)
    yield _copies()
    yield from _pairs(full)


def _fits(full: bool) -> Iterator[tuple[HardSet, tuple[float, float], bool]]:
    """Yield sets and penalties, and whether the solution must predict every frame correctly."""
    for classes in (2, 14, 33) if full else (2, 14):
        for hard in (separable(classes, 1), separable(classes), words(classes)):
            yield hard, USUAL, True
            yield hard, TINY, True
            yield hard, HUGE, False
        yield intervals(min(classes, BINS), 1), TINY, True
    yield separable(1000 if full else 60, 1), USUAL, True
    for pulls in (USUAL, TINY, HUGE):
        yield noisy(5, 40, 0.5, seed=3), pulls, False
        for counts in ([[10**6 if full else 10**4, 1], [1, 1]], [[10**4, 0, 1], [1, 10**4, 0], [0, 1, 10**2]]):
            hard = contradictory(counts)
            rows = np.repeat(np.arange(len(hard.X)), hard.row_weights.astype(int))
            yield replace(hard.rows(rows), weights=None), pulls, False


def _fit(hard: HardSet, pulls: tuple[float, float]) -> ColumnTables:
    penalty, smoothness = pulls
    return fit_logit(hard.X, hard.labels, hard.n_classes, penalty=penalty, smoothness=smoothness)


def _unrest(hard: HardSet, tables: ColumnTables, pulls: tuple[float, float]) -> float:
    penalty, smoothness = pulls
    columns = [_bias(tables.bias, penalty, len(hard.X))]
    for x, edges, rows in zip(hard.X.T, tables.edges, tables.rows, strict=True):
        two = len(edges) < 2
        own = rows[1:] if two else rows
        pulled = [penalty if two else BIN_SHARE * penalty] * len(own)
        steps = [(number, number + 1, smoothness) for number in range(len(pulled) - 1)]
        columns.append(ReferenceColumn((np.searchsorted(edges, x) - two).tolist(), own.tolist(), pulled, steps))
    return _share_of_allowed(columns, hard.labels, hard.n_classes)


def _bias(bias: Floats, penalty: float, n: int) -> ReferenceColumn:
    return ReferenceColumn([0] * n, [bias.tolist()], [BIAS_SHARE * penalty], [])


@precisely()
def _share_of_allowed(columns: list[ReferenceColumn], labels: NDArray[np.intp], n_classes: int) -> float:
    """Return the largest derivative as a share of the tolerance plus rounding.

    Scores are exact. A probability of K classes is within K + 8 roundings; the grid of residuals, and the penalty of a
    row, which is at most the number of rows, add a few more roundings.
    """
    largest = largest_derivative(columns, labels.tolist())
    return float(largest / ((TOLERANCE + (n_classes + 20) * 2 * ROUNDING) * len(labels)))


def _copies() -> Finding:
    """Equal columns must have the same rows, to the last bit."""
    worst = Finding.of("copies of a column with different rows", "each other", 0.0, "columns")
    hard = noisy(5, 60, 0.3, seed=1)
    doubled = replace(hard, X=np.column_stack([hard.X[:, :3], hard.X, hard.X[:, -1]]))
    for pulls in (USUAL, TINY, HUGE):
        rows = _fit(doubled, pulls).rows
        for one, other in ((0, 3), (1, 4), (2, 5), (-1, -2)):
            worst.see(float(not np.array_equal(rows[one], rows[other])), f"columns {one} and {other}, pulls {pulls}")
    return worst


def _pairs(full: bool) -> Iterator[Finding]:
    """Yield the same for tables of pairs of joints, with types separable only by two joints together, or not at all."""
    at_rest = Finding.of("largest derivative with pairs of joints", REFERENCE, 1.0, "x tolerance and rounding")
    overflow = Finding.of("largest sum of integer tables with pairs", "the proven bound of the tables", LIMIT, "steps")
    wrong = Finding.of("frames of crossed joints predicted wrongly by integers", "their labels", 0.0, "frames")
    changed = Finding.of("tables of pairs that change with the order of rows", "themselves", 0.0, "tables")
    for apart, (penalty, smoothness) in product((1, 1000), (USUAL, TINY, HUGE)):
        random = np.random.default_rng(apart)
        codes = random.integers(0, 4, (160 if full else 60, 4)).astype(np.uint16) * np.uint16(apart)
        labels = ((codes[:, 0] > apart) ^ (codes[:, 1] > apart)).astype(np.intp)
        none, order = np.zeros((len(codes), 0), bool), random.permutation(len(codes))
        own: dict[str, Any] = {"penalty": penalty, "smoothness": smoothness, "pair_smoothness": smoothness}
        for targets, is_separable in ((labels, penalty < 1), (random.permutation(labels), False)):
            tables, again = (
                fit_pairs(none[rows], codes[rows], targets[rows], 2, max_bins=8, **own) for rows in (slice(None), order)
            )
            at = f"codes {apart} apart, penalty {penalty:g}"
            at_rest.see(_pairs_unrest(tables, codes, targets, penalty, smoothness), at)
            integers = quantise(tables, none, codes)
            overflow.see(float(integers.bound), at)
            if is_separable:
                named = integers.scores(none, codes).argmax(axis=1)
                wrong.see(float(np.count_nonzero(named != targets)), at, len(codes))
            both = ([one.bias, *one.joint_rows, *(pair.rows for pair in one.grids)] for one in (tables, again))
            changed.see(float(not all(np.array_equal(*numbers) for numbers in zip(*both, strict=True))), at)
    yield from (at_rest, overflow, wrong, changed)


def _pairs_unrest(
    tables: ScoreTables, codes: NDArray[np.uint16], labels: NDArray[np.intp], penalty: float, smoothness: float
) -> float:
    columns, pull = [_bias(tables.bias, penalty, len(codes))], BIN_SHARE * penalty
    for steps, rows, x in zip(tables.thresholds, tables.joint_rows, codes.T, strict=True):
        between = [(bin_, bin_ + 1, smoothness) for bin_ in range(len(steps))]
        columns.append(ReferenceColumn(np.searchsorted(steps, x).tolist(), rows.tolist(), [pull] * len(rows), between))
    for pair in tables.grids:
        down, across = pair.rows.shape[:2]
        one, other = (np.searchsorted(t, codes[:, a]) for a, t in zip(pair.joints, pair.thresholds, strict=True))
        cells = np.arange(down * across).reshape(down, across)
        both = zip([*cells[1:].flat, *cells[:, 1:].flat], [*cells[:-1].flat, *cells[:, :-1].flat], strict=True)
        between = [(int(b), int(a), smoothness) for a, b in both]
        flat = pair.rows.reshape(down * across, -1).tolist()
        columns.append(ReferenceColumn((one * across + other).tolist(), flat, [pull] * len(flat), between))
    return _share_of_allowed(columns, labels, 2)
