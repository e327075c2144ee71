"""Quantisation of scores to integers of 4 to 16 bits, in the worst possible frame."""

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import permutations
from typing import NamedTuple

import numpy as np

from thenar.compiler.model.compare import float_slack
from thenar.runtime.model.integers import MAX_SWITCHES, IntegerTables
from thenar.runtime.model.proof import Rounding
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import Floats
from thenar.runtime.scores import LANE_OFFSET, Scorer

from ..finding import Finding
from ..inputs.hard_tables import every_frame, listed, rows_of
from ..inputs.small_sets import small_build, small_set
from ..reference.tables import rows_of_frame

WIDTHS = range(4, 17)
_SWITCHES, _BINS = 6, (5, 4, 3)
_N = _SWITCHES + len(_BINS)


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


def quantised(name: str, tables: ScoreTables, width: int = 16, seed: int = 0) -> Quantised:
    """Return `tables` quantised by the compiler, with 50 random training rows."""
    random = np.random.default_rng(seed)
    bits = random.random((50, len(tables.switch_rows))) < 0.5
    codes = random.integers(0, 256, (50, len(tables.thresholds))).astype(np.uint16)
    return Quantised(name, tables, quantise(tables, bits, codes, width))


Run = tuple[list[int], list[int]]  # scores (K,) from the tables and from the integers


def both_scores(case: Quantised, frames: Iterable[tuple[Sequence[bool], Sequence[int]]]) -> tuple[list[Run], int]:
    """Return the scores of frames, exactly: in parts of a step; and the number of parts."""
    scale = Fraction(case.integers.scale)
    entries = (Fraction(entry) for rows in rows_of(case.tables) for row in rows for entry in row)
    # All denominators are powers of two.
    parts = max(entry.denominator for entry in entries) * scale.denominator

    def whole(rows: list[list[float]]) -> list[list[int]]:
        return [[int(Fraction(entry) * scale * parts) for entry in row] for row in rows]

    bias, switch_rows, thresholds, joint_rows = listed(case.tables)
    tables = whole([bias])[0], whole(switch_rows), thresholds, list(map(whole, joint_rows))
    scorer, runs = Scorer(case.integers), []
    for frame in frames:
        exact = [sum(column) for column in zip(*rows_of_frame(*tables, *frame), strict=True)]
        runs.append((exact, [(lane - LANE_OFFSET) * parts for lane in scorer.biased_scores(*frame)]))
    return runs, parts


def lost(run: Run, leader: int, other: int) -> int:
    """Return the lost parts of the lead of class `leader` over `other`."""
    exact, deployed = run
    return (exact[leader] - exact[other]) - (deployed[leader] - deployed[other])


def findings(full: bool) -> Iterator[Finding]:
    """Compare the integers with exact scores in frames, in all frames of small tables, and with plain counting."""
    witnesses, leads = _worst_frames(range(40 if full else 3))
    yield witnesses
    yield from _all_frames(range(12 if full else 2))
    yield leads
    yield _half_steps(full)


def _worst_frames(seeds: range) -> tuple[Finding, Finding]:
    worst = Finding.of("worst frame of every pair of classes", "60 digits and the scorer, in that frame", 0, "steps")
    cases = list(_tables(seeds))
    # Half a step for the bias and each input's row, twice, for two classes; plus the error of doubles on the way. As a
    # share of n + 1 steps, which is the same for all of these tables.
    slack = max(2 * float_slack(case.tables, case.integers.scale) for case in cases)
    leads = Finding.of("lead lost in the worst frame, 4 to 16 bits", "half a step an input", _N + 1 + slack, "steps")
    small = small_build(small_set(7, rows=200, switches=24, joints=3, types=6, noise=0.15), rounds=40)
    compiled = Quantised("a compiled build", small.tables, small.build.tables)
    for case in (compiled, *cases):
        rounding = Rounding(case.tables, case.integers)
        pairs = list(permutations(range(case.integers.n_classes), 2))
        frames = [rounding.worst(*pair) for pair in pairs]
        runs, parts = both_scores(case, ((frame.bits.tolist(), frame.codes.tolist()) for frame in frames))
        for pair, frame, run in zip(pairs, frames, runs, strict=True):
            error = float(abs(Fraction(lost(run, *pair), parts) - frame.loss))
            worst.see(error, f"{case.name}, classes {pair[0]} and {pair[1]}")
        if case is not compiled:
            leads.see(float(rounding.worst_of_all().loss), case.name)
    return worst, leads


def _all_frames(seeds: range) -> Iterator[Finding]:
    """Small tables: compare the computed loss of the worst frame with the largest loss of any frame."""
    most = Finding.of("largest loss of any frame, all pairs", "60 digits, every frame there is", 0, "steps")
    # A share of the proven bound: no frame can exceed 1.
    overturned = Finding.of(
        "widest margin that integers reverse", "60 digits, every frame there is", 1, "of the safe margin"
    )
    for case in _small(seeds):
        rounding = Rounding(case.tables, case.integers)
        runs, parts = both_scores(case, every_frame(case.tables))
        for pair in permutations(range(case.integers.n_classes), 2):
            error = abs(Fraction(max(lost(run, *pair) for run in runs), parts) - rounding.worst(*pair).loss)
            most.see(float(error), f"{case.name}, classes {pair[0]} and {pair[1]}", len(runs))
        turned = (exact for exact, deployed in runs if exact.index(max(exact)) != deployed.index(max(deployed)))
        margin = Fraction(max((max(exact) - sorted(exact)[-2] for exact in turned), default=0), parts)
        # Nothing is reversed if the safe margin is 0.
        overturned.see(float(margin / rounding.safe_margin()) if margin else 0.0, case.name, len(runs))
    yield from (most, overturned)


def _half_steps(full: bool) -> Finding:
    # The bound is attained: every row is exactly half a step off, in opposite directions for the two classes.
    worst = Finding.of("all rows half a step off", "half a step an input, exactly", 0, "steps")
    for switches, width in ((1, 4), (1, 16), (2, 8), (31, 8), (MAX_SWITCHES if full else 256, 16)):
        case = quantised(f"{switches} switches, {width} bits", half_a_step_off(switches, 2 ** (width - 1) - 1), width)
        loss = Rounding(case.tables, case.integers).worst_of_all().loss
        worst.see(float(abs(loss - (switches + 1))), case.name)
    return worst


def _tables(seeds: range) -> Iterator[Quantised]:
    for seed in seeds:
        for width in WIDTHS:
            yield quantised(f"draw {seed}, {width} bits", drawn(seed, 4, _SWITCHES, _BINS), width)
        for factor in (1e-6, 1e3, 1e6):
            tables = dominated(seed, 4, _SWITCHES, _BINS, factor)
            yield quantised(f"draw {seed}, one class times {factor:g}", tables)
        # Zero, subnormal, one or two steps at the finest scale, and close to the largest doubles.
        for factor in (0.0, 1e-310, 1e-10, 1e300):
            tables = sized(drawn(seed, 4, _SWITCHES, _BINS), factor)
            yield quantised(f"draw {seed}, all times {factor:g}", tables)


def _small(seeds: range) -> Iterator[Quantised]:
    for seed in seeds:
        for width in (4, 5, 6, 16):
            yield quantised(f"draw {seed}, {width} bits", drawn(seed, 3, 3, (4, 3), 0.5), width)
        yield quantised(f"draw {seed}, 2 classes, 1 switch", drawn(seed, 2, 1, ()), 4)
        yield quantised(f"draw {seed}, 2 classes, 1 joint", drawn(seed, 2, 0, (6,)), 4)
        yield quantised(f"draw {seed}, one class times 1000", dominated(seed, 3, 3, (3,), 1e3), 8)
