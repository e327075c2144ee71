"""Conversion of ensembles of thousands of rounds to score tables and whole steps."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.compiler.model.collapse import collapse
from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.model.quantise import balance, quantise
from thenar.runtime.model.tables import ScoreTables

from ..checks.rounds import ROUNDING, SMALLEST, part_of
from ..finding import REFERENCE, Finding
from ..inputs.hard_tables import listed
from ..reference import boosting as truth
from ..reference import tables
from ..reference.numbers import precisely

X_ROUNDING = "x rounding"
SWITCHES, JOINTS = 3, 2
_BESIDE = np.nextafter([7.0, 7.0, 0.0, 0.0, 65535.0], [0.0, 8.0, 1.0, -1.0, 0.0])  # one double from a code
CODES = np.array([*_BESIDE, 7.0, 7.5, 0.0, -0.5, 128.5, 65534.0, 65534.5, 65535.0, 1e300, -1e300])
BITS = np.array([*_BESIDE[2:4], -0.5, 0.0, 0.5, 1.0, 1e300, -1e300])


@dataclass(frozen=True)
class Ensemble:
    """An ensemble, and its kind."""

    kind: str
    stumps: Stumps

    @property
    def name(self) -> str:
        """Its size and kind."""
        return f"{self.stumps.n_rounds} rounds, {self.stumps.n_classes} classes: {self.kind}"

    @cached_property
    def tables(self) -> ScoreTables:
        """Its score tables."""
        return collapse(self.stumps, SWITCHES)

    @cached_property
    def sums(self) -> truth.Sums:
        """The sums of its equal stumps."""
        parts = self.stumps.columns, self.stumps.thresholds, self.stumps.values
        return truth.branch_sums(*(part.tolist() for part in parts))


def ensembles(rng: np.random.Generator, n: int, rounds: int) -> Iterator[Ensemble]:
    """Yield n ensembles of each kind and up to 33 classes, over 3 switches and 2 joints; outputs within 3."""
    for number in range(n):
        classes = int(rng.choice([2, 3, 5, 14, 33]))
        shape = rounds, classes, 3
        shrinkage = (1.0, 0.1, 1e-5)[number % 3]
        yield Ensemble("outputs of +-3", _stumps(rng, rng.choice([-3.0, 3.0], shape), shrinkage))
        sizes = rng.choice([-3.0, 3.0], shape) * 10.0 ** rng.uniform(-20, 0, shape)
        yield Ensemble("outputs of all sizes", _stumps(rng, sizes, shrinkage))
        once = _stumps(rng, rng.uniform(-3, 3, (1, classes, 3)), shrinkage)
        again = {part: getattr(once, part).repeat(rounds, axis=0) for part in ("columns", "thresholds", "values")}
        yield Ensemble("one round repeated", replace(once, **again))
        subnormal = np.ldexp(rng.integers(-9, 10, (20, classes, 3)).astype(np.float64), -1074)
        yield Ensemble("outputs close to zero", _stumps(rng, subnormal, 1.0))


def frames(rng: np.random.Generator, n: int) -> tuple[NDArray[np.bool_], NDArray[np.uint16]]:
    """Return bits (n, 3) and codes (n, 2), including codes at thresholds."""
    codes = rng.choice([0, 1, 6, 7, 8, 128, 129, 65534, 65535], (n, JOINTS)).astype(np.uint16)
    return rng.random((n, SWITCHES)) < 0.5, codes


def _stumps(rng: np.random.Generator, values: NDArray[np.float64], shrinkage: float) -> Stumps:
    shape = values.shape[:2]
    columns = rng.integers(0, SWITCHES + JOINTS, shape)
    thresholds = np.where(columns < SWITCHES, rng.choice(BITS, shape), rng.choice(CODES, shape))
    return Stumps(SWITCHES + JOINTS, columns.astype(np.int32), thresholds, values, shrinkage)


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of scores, of tables, of balanced tables and of whole steps."""
    rng = np.random.default_rng(6)
    hard = list(ensembles(rng, 3 if full else 2, 10_000 if full else 1000))
    bits, codes = frames(rng, 12 if full else 4)
    yield from scores_of(hard, bits, codes)
    yield from tables_of(hard)
    yield table_scores_of(hard, bits, codes)
    yield balanced_of(hard)
    yield whole_steps_of(rng, hard)


def scores_of(hard: list[Ensemble], bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> Iterator[Finding]:
    """Compare the ensembles' scores of frames with the reference."""
    # A step is (K - 1)/K (g - mean g). Its roundings, in units of 2^-53 times the largest |g|: shrinkage 2, here and in
    # the mean, partial sums over K (K + 1)/2, mean 1, difference 2, all times (K - 1)/K, and the last two operations
    # 2 ((K - 1)/K)^2 each; for every K > 1 the sum is below K + 4. Rounds are added with compensation, so that their
    # sum rounds once.
    worst = Finding.of("scores of thousands of rounds", REFERENCE, 1.0, X_ROUNDING)
    mean = Finding.of("mean of the scores of all classes", "zero", 1.0, X_ROUNDING)
    X = np.hstack([bits, codes])
    for ensemble in hard:
        stumps, K, sums = ensemble.stumps, ensemble.stumps.n_classes, ensemble.sums
        largest = mpmath.fsum(np.abs(stumps.values).max(axis=(1, 2)).tolist()) * stumps.shrinkage
        for row, got in zip(X.tolist(), stumps.scores(X).tolist(), strict=True):
            exact = truth.scores(sums, K, stumps.shrinkage, dict(enumerate(row)))
            with precisely():
                steps = (K + 4) * (ROUNDING * largest + stumps.n_rounds * SMALLEST)
                for ours, true in zip(got, exact, strict=True):
                    worst.see(part_of(ours, true, steps + ROUNDING * abs(true)), ensemble.name)
                off = abs(mpmath.fsum(got)) / K / (steps + ROUNDING * max(map(abs, exact)))
                mean.see(float(off), ensemble.name)
    yield from (worst, mean)


def _sizes(stumps: Stumps) -> Floats:
    """Return the sum over an input's stumps of the magnitudes of their left and right branches, (n_inputs, K)."""
    K = stumps.n_classes
    spread = stumps.shrinkage * (K - 1) / K * np.abs(np.eye(K) - 1 / K)
    sizes = np.zeros((stumps.n_inputs, K))
    np.add.at(sizes, stumps.columns, np.abs(stumps.values[:, :, :2]).sum(axis=2)[:, :, np.newaxis] * spread)
    return sizes


def tables_of(hard: list[Ensemble]) -> Iterator[Finding]:
    """Compare the tables of ensembles with the reference."""
    # A stump's part g - mean g, with one nonzero g, rounds 5 times; the difference of a switch's two values once more.
    # They are summed with compensation, and rounded once; the bias is a sum over the switches.
    rows = Finding.of("rows of score tables", REFERENCE, 1.0, X_ROUNDING)
    thresholds = Finding.of("thresholds of score tables", "whole numbers", 0.0, "joints")
    for ensemble in hard:
        stumps, ours = ensemble.stumps, ensemble.tables
        of_ensemble = ensemble.sums, stumps.n_classes, stumps.shrinkage
        bias, switch_rows, joints = tables.score_tables(*of_ensemble, stumps.n_inputs, SWITCHES)
        sizes, tiny = _sizes(stumps), 6 * stumps.n_rounds * stumps.n_classes * SMALLEST
        parts = [(ours.bias, bias, (6 + SWITCHES) * sizes[:SWITCHES].sum(axis=0))]
        parts += [(a, b, 6 * size) for a, b, size in zip(ours.switch_rows, switch_rows, sizes, strict=False)]
        of_joints = zip(joints, ours.thresholds, ours.joint_rows, sizes[SWITCHES:], strict=True)
        for (steps, exact), codes, table, size in of_joints:
            thresholds.see(float(codes.tolist() != steps), ensemble.name)
            parts += [(a, b, 5 * size) for a, b in zip(table, exact, strict=True)]
        for row, exact_row, roundings in parts:
            for got, true, units in zip(row.tolist(), exact_row, roundings.tolist(), strict=True):
                with precisely():
                    rows.see(part_of(got, true, ROUNDING * (units + abs(true)) + tiny), ensemble.name)
    yield from (rows, thresholds)


def table_scores_of(hard: list[Ensemble], bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> Finding:
    """Compare the scores of frames by tables with the reference, given the tables."""
    # One row per input is added to the bias: one rounding each, of a partial sum.
    worst = Finding.of("scores from tables", REFERENCE, 1.0, X_ROUNDING)
    for ensemble in hard:
        ours = ensemble.tables
        rows = (*ours.switch_rows[:, np.newaxis], *ours.joint_rows)
        size = (np.abs(ours.bias) + sum(np.abs(of).max(axis=0) for of in rows)).tolist()
        frames_and_scores = zip(bits.tolist(), codes.tolist(), ours.scores(bits, codes).tolist(), strict=True)
        for *frame, got in frames_and_scores:
            exact = tables.added_rows(tables.rows_of_frame(*listed(ours), *frame))
            for a, b, magnitude in zip(got, exact, size, strict=True):
                with precisely():
                    worst.see(part_of(a, b, ours.n_inputs * ROUNDING * mpf(magnitude)), ensemble.kind)
    return worst


def balanced_of(hard: list[Ensemble]) -> Finding:
    """Compare balanced tables with the reference, given the original tables."""
    # With j joints and M = |bias| + the largest rows: the bias to remove rounds j + 1 times, the share of a span j + 3
    # times, its product, sum and difference 3 times; the new bias is a sum of j of those and the old one.
    worst = Finding.of("balanced tables", REFERENCE, 1.0, X_ROUNDING)
    for ensemble in hard:
        before = ensemble.tables
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
                    worst.see(part_of(got, true, times * (ROUNDING * mpf(size) + SMALLEST)), ensemble.kind)
    return worst


def whole_steps_of(rng: np.random.Generator, hard: list[Ensemble]) -> Finding:
    """Check the rounding of rows to whole steps."""
    # Rounding is by half a step; the product before it by 2^-53 of 32767 steps.
    rows = Finding.of("rows in whole steps", "fractions", 0.5 + 32767 * 2.0**-53, "steps")
    for ensemble in hard:
        bits, codes = frames(rng, 57)
        ours = balance(ensemble.tables)
        integers = quantise(ours, bits, codes)
        scale = Fraction(integers.scale)
        for got, row in zip((integers.bias, *integers.switch_rows), (ours.bias, *ours.switch_rows), strict=True):
            for whole, exact in zip(got.tolist(), row.tolist(), strict=True):
                rows.see(float(abs(whole - Fraction(exact) * scale)))
    return rows
