"""Conversion of ensembles of thousands of rounds to score tables and whole steps."""

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.compiler.model.collapse import collapse
from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.model.quantise import balance, quantise

from ..checks.roundings import ROUNDING, SMALLEST, part_of
from ..finding import REFERENCE, Case, Finding, Worst
from ..reference import boosting as truth
from ..reference import tables
from ..reference.numbers import precisely

SWITCHES, JOINTS = 3, 2
_BESIDE = np.nextafter([7.0, 7.0, 0.0, 0.0, 65535.0], [0.0, 8.0, 1.0, -1.0, 0.0])  # one double from a code
CODES = np.array([*_BESIDE, 7.0, 7.5, 0.0, -0.5, 128.5, 65534.0, 65534.5, 65535.0, 1e300, -1e300])
BITS = np.array([*_BESIDE[2:4], -0.5, 0.0, 0.5, 1.0, 1e300, -1e300])


def ensembles(rng: np.random.Generator, n: int, rounds: int) -> Iterator[tuple[str, Stumps]]:
    """Yield n ensembles of each kind and up to 33 classes, over 3 switches and 2 joints; outputs within 3."""
    for number in range(n):
        classes = int(rng.choice([2, 3, 5, 14, 33]))
        shape = rounds, classes, 3
        shrinkage = (1.0, 0.1, 1e-5)[number % 3]
        yield "outputs of +-3", _stumps(rng, rng.choice([-3.0, 3.0], shape), shrinkage)
        sizes = rng.choice([-3.0, 3.0], shape) * 10.0 ** rng.uniform(-20, 0, shape)
        yield "outputs of all sizes", _stumps(rng, sizes, shrinkage)
        once = _stumps(rng, rng.uniform(-3, 3, (1, classes, 3)), shrinkage)
        again = {part: getattr(once, part).repeat(rounds, axis=0) for part in ("columns", "thresholds", "values")}
        yield "one round repeated", replace(once, **again)
        subnormal = np.ldexp(rng.integers(-9, 10, (20, classes, 3)).astype(np.float64), -1074)
        yield "outputs close to zero", _stumps(rng, subnormal, 1.0)


def frames(rng: np.random.Generator, n: int) -> tuple[NDArray[np.bool_], NDArray[np.uint16]]:
    """Return bits (n, 3) and codes (n, 2), including codes at thresholds."""
    codes = rng.choice([0, 1, 6, 7, 8, 128, 129, 65534, 65535], (n, JOINTS)).astype(np.uint16)
    return rng.random((n, SWITCHES)) < 0.5, codes


def _stumps(rng: np.random.Generator, values: NDArray[np.float64], shrinkage: float) -> Stumps:
    shape = values.shape[:2]
    columns = rng.integers(0, SWITCHES + JOINTS, shape)
    thresholds = np.where(columns < SWITCHES, rng.choice(BITS, shape), rng.choice(CODES, shape))
    return Stumps(SWITCHES + JOINTS, columns.astype(np.int32), thresholds, values, shrinkage)


CASE = Case(
    title="Score tables",
    danger="scores drift over thousands of rounds, tables differ from the stumps they are made of",
)
X_ROUNDING = "x rounding"


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of scores, of tables, of balanced tables and of whole steps."""
    rng = np.random.default_rng(6)
    hard = list(ensembles(rng, 3 if full else 2, 10_000 if full else 1000))
    bits, codes = frames(rng, 12 if full else 4)
    yield from scores_of(hard, bits, codes)
    yield from tables_of(hard)
    yield table_scores_of(hard, bits, codes)
    yield balanced_of(hard)
    yield from whole_steps_of(rng, hard)


def scores_of(hard: list[tuple[str, Stumps]], bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> Iterator[Finding]:
    """Compare the ensembles' scores of frames with the reference."""
    # A step is (K - 1)/K (g - mean g). Its roundings, in units of 2^-53 times the largest |g|: shrinkage 2, here and in
    # the mean, partial sums over K (K + 1)/2, mean 1, difference 2, all times (K - 1)/K, and the last two operations
    # 2 ((K - 1)/K)^2 each; for every K > 1 the sum is below K + 4. Rounds are added with compensation, so that their
    # sum rounds once.
    worst = Worst("scores of thousands of rounds", REFERENCE, 1.0, X_ROUNDING)
    mean = Worst("mean of the scores of all classes", "zero", 1.0, X_ROUNDING)
    X = np.hstack([bits, codes])
    for name, stumps in hard:
        at, K = f"{stumps.n_rounds} rounds, {stumps.n_classes} classes: {name}", stumps.n_classes
        largest = mpmath.fsum(np.abs(stumps.values).max(axis=(1, 2)).tolist()) * stumps.shrinkage
        for row, got in zip(X.tolist(), stumps.scores(X).tolist(), strict=True):
            exact = truth.scores(*_listed(stumps), row)
            with precisely():
                steps = (K + 4) * (ROUNDING * largest + stumps.n_rounds * SMALLEST)
                for ours, true in zip(got, exact, strict=True):
                    worst.see(part_of(ours, true, steps + ROUNDING * abs(true)), at)
                mean.see(float(abs(mpmath.fsum(got)) / K / (steps + ROUNDING * max(map(abs, exact)))), at)
    yield from (worst.finding(), mean.finding())


def _listed(stumps: Stumps) -> tuple[Any, Any, Any, float]:
    """Return an ensemble in the form of the reference."""
    return stumps.columns.tolist(), stumps.thresholds.tolist(), stumps.values.tolist(), stumps.shrinkage


def _sizes(stumps: Stumps) -> Floats:
    """Return the sum over an input's stumps of the magnitudes of their left and right branches, (n_inputs, K)."""
    K = stumps.n_classes
    spread = stumps.shrinkage * (K - 1) / K * np.abs(np.eye(K) - 1 / K)
    sizes = np.zeros((stumps.n_inputs, K))
    np.add.at(sizes, stumps.columns, np.abs(stumps.values[:, :, :2]).sum(axis=2)[:, :, np.newaxis] * spread)
    return sizes


def tables_of(hard: list[tuple[str, Stumps]]) -> Iterator[Finding]:
    """Compare the tables of ensembles with the reference."""
    # A stump's part g - mean g, with one nonzero g, rounds 5 times; the difference of a switch's two values once more.
    # They are summed with compensation, and rounded once; the bias is a sum over the switches.
    rows = Worst("rows of score tables", REFERENCE, 1.0, X_ROUNDING)
    thresholds = Worst("thresholds of score tables", "whole numbers", 0.0, "joints")
    for name, stumps in hard:
        at = f"{stumps.n_rounds} rounds, {stumps.n_classes} classes: {name}"
        bias, switch_rows, joints = tables.score_tables(*_listed(stumps), stumps.n_inputs, SWITCHES)
        ours = collapse(stumps, SWITCHES)
        sizes, tiny = _sizes(stumps), 6 * stumps.n_rounds * stumps.n_classes * SMALLEST
        parts = [(ours.bias, bias, (6 + SWITCHES) * sizes[:SWITCHES].sum(axis=0))]
        parts += [(a, b, 6 * size) for a, b, size in zip(ours.switch_rows, switch_rows, sizes, strict=False)]
        for (steps, exact), codes, table, size in zip(
            joints, ours.thresholds, ours.joint_rows, sizes[SWITCHES:], strict=True
        ):
            thresholds.see(float(codes.tolist() != steps), at)
            parts += [(a, b, 5 * size) for a, b in zip(table, exact, strict=True)]
        for row, exact_row, counted in parts:
            for got, true, units in zip(row.tolist(), exact_row, counted.tolist(), strict=True):
                with precisely():
                    rows.see(part_of(got, true, ROUNDING * (units + abs(true)) + tiny), at)
    yield from (rows.finding(), thresholds.finding())


def table_scores_of(hard: list[tuple[str, Stumps]], bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> Finding:
    """Compare the scores of frames by tables with the reference, given the tables."""
    # One row per input is added to the bias: one rounding each, of a partial sum.
    worst = Worst("scores from tables", REFERENCE, 1.0, X_ROUNDING)
    for name, stumps in hard:
        ours = collapse(stumps, SWITCHES)
        size = np.abs(ours.bias) + sum(
            np.abs(rows).max(axis=0) for rows in (*ours.switch_rows[:, np.newaxis], *ours.joint_rows)
        )
        thresholds, joints = ([part.tolist() for part in parts] for parts in (ours.thresholds, ours.joint_rows))
        frames_and_scores = zip(bits.tolist(), codes.tolist(), ours.scores(bits, codes).tolist(), strict=True)
        for closed, of_joints, got in frames_and_scores:
            exact = tables.table_scores(
                ours.bias.tolist(), ours.switch_rows.tolist(), thresholds, joints, closed, of_joints
            )
            for a, b, magnitude in zip(got, exact, size.tolist(), strict=True):
                with precisely():
                    worst.see(part_of(a, b, ours.n_inputs * ROUNDING * mpf(magnitude)), name)
    return worst.finding()


def balanced_of(hard: list[tuple[str, Stumps]]) -> Finding:
    """Compare balanced tables with the reference, given the original tables."""
    # With j joints and M = |bias| + the largest rows: the bias to remove rounds j + 1 times, the share of a span j + 3
    # times, its product, sum and difference 3 times; the new bias is a sum of j of those and the old one.
    worst = Worst("balanced tables", REFERENCE, 1.0, X_ROUNDING)
    for name, stumps in hard:
        before = collapse(stumps, SWITCHES)
        after, j = balance(before), len(before.joint_rows)
        bias, joints = tables.balanced(before.bias.tolist(), [rows.tolist() for rows in before.joint_rows])
        reach = sum(np.abs(rows).max(axis=0) + np.ptp(rows, axis=0) for rows in before.joint_rows)
        M = (np.abs(before.bias) + reach).tolist()
        pairs = [(after.bias.tolist(), bias, 3 * j + 7)]
        for ours, exact in zip(after.joint_rows, joints, strict=True):
            pairs += [(a, b, 2 * j + 7) for a, b in zip(ours.tolist(), exact, strict=True)]
        for row, exact_row, times in pairs:
            for got, true, size in zip(row, exact_row, M, strict=True):
                with precisely():
                    worst.see(part_of(got, true, times * (ROUNDING * mpf(size) + SMALLEST)), name)
    return worst.finding()


def whole_steps_of(rng: np.random.Generator, hard: list[tuple[str, Stumps]]) -> list[Finding]:
    """Check the rounding of rows to whole steps."""
    # Rounding is by half a step; the product before it by 2^-53 of 32767 steps.
    rows = Worst("rows in whole steps", "fractions", 0.5 + 32767 * 2.0**-53, "steps")
    for _, stumps in hard:
        bits, codes = frames(rng, 57)
        ours = balance(collapse(stumps, SWITCHES))
        integers = quantise(ours, bits, codes)
        scale = Fraction(integers.scale)
        for got, row in zip((integers.bias, *integers.switch_rows), (ours.bias, *ours.switch_rows), strict=True):
            for whole, exact in zip(got.tolist(), row.tolist(), strict=True):
                rows.see(float(abs(whole - Fraction(exact) * scale)))
    return [rows.finding()]
