"""Quantisation of scores to integers of 4 to 16 bits, in the worst possible frame."""

from collections.abc import Iterator, Sequence
from itertools import permutations

from mpmath import mpf

from thenar.compiler.model.compare import float_slack
from thenar.runtime.model.integers import MAX_SWITCHES
from thenar.runtime.model.proof import Rounding
from thenar.runtime.scores import LANE_OFFSET, Scorer

from ..finding import Case, Finding, Worst
from ..inputs.hard_tables import (
    Quantised,
    dominated,
    drawn,
    every_frame,
    first_best,
    half_a_step_off,
    quantised,
    sized,
)
from ..inputs.small_sets import small_build, small_set
from ..reference.numbers import precisely, ratio
from ..reference.tables import table_scores


@precisely()
def both_scores(case: Quantised, bits: Sequence[bool], codes: Sequence[int]) -> tuple[list[mpf], list[int]]:
    """Return the frame's scores (K,) in steps: exact, and from the integer tables."""
    tables = case.tables
    thresholds, joints = ([part.tolist() for part in parts] for parts in (tables.thresholds, tables.joint_rows))
    scores = table_scores(tables.bias.tolist(), tables.switch_rows.tolist(), thresholds, joints, bits, codes)
    deployed = [lane - LANE_OFFSET for lane in Scorer(case.integers).lanes(bits, codes)]
    return [score * case.integers.scale for score in scores], deployed


@precisely()
def lost(exact: Sequence[mpf], deployed: Sequence[int], leader: int, other: int) -> mpf:
    """Return the lost steps of the lead of class `leader` over `other`."""
    return (exact[leader] - exact[other]) - (deployed[leader] - deployed[other])


CASE = Case(
    title="Integers of 4 to 16 bits",
    danger="rounding changes a score or a decision more than guaranteed",
)

WIDTHS = range(4, 17)
_SWITCHES, _BINS = 6, (5, 4, 3)
_N = _SWITCHES + len(_BINS)


def findings(full: bool) -> Iterator[Finding]:
    """Compare the integers with 60 digits in frames, in all frames of small tables, and with plain counting."""
    seeds = range(40 if full else 3)
    yield _witnesses(seeds)
    yield from _all_frames(range(12 if full else 2))
    yield _leads(seeds)
    yield _half_steps(full)


def _witnesses(seeds: range) -> Finding:
    # Both sides are exact: rows of about 75 bits between their highest and lowest place, times a scale of 53 bits, fit
    # into the 199 bits of 60 digits.
    worst = Worst("worst frame of every pair of classes", "60 digits and the scorer, in that frame", 0, "steps")
    small = small_build(small_set(7, rows=200, switches=24, joints=3, types=6, noise=0.15), rounds=40)
    for case in (Quantised("a compiled build", small.tables, small.build.tables), *_tables(seeds)):
        rounding = Rounding(case.tables, case.integers)
        for leader, other in permutations(range(case.integers.n_classes), 2):
            frame = rounding.worst(leader, other)
            exact, deployed = both_scores(case, frame.bits.tolist(), frame.codes.tolist())
            with precisely():
                error = float(abs(lost(exact, deployed, leader, other) - ratio(frame.loss)))
            worst.see(error, f"{case.name}, classes {leader} and {other}")
    return worst.finding()


def _all_frames(seeds: range) -> Iterator[Finding]:
    """Small tables: compare the computed loss of the worst frame with the largest loss of any frame."""
    most = Worst("largest loss of any frame, all pairs", "60 digits, every frame there is", 0, "steps")
    # A share of the proven bound: no frame can exceed 1.
    overturned = Worst(
        "widest margin that integers reverse", "60 digits, every frame there is", 1, "of the safe margin"
    )
    for case in _small(seeds):
        rounding, pairs = Rounding(case.tables, case.integers), list(permutations(range(case.integers.n_classes), 2))
        safe = ratio(rounding.safe_margin())
        runs = [both_scores(case, *frame) for frame in every_frame(case.tables)]
        with precisely():
            for pair in pairs:
                found = max(lost(exact, deployed, *pair) for exact, deployed in runs)
                error = abs(found - ratio(rounding.worst(*pair).loss))
                most.see(float(error), f"{case.name}, classes {pair[0]} and {pair[1]}", len(runs))
            margins = [
                max(exact) - sorted(exact)[-2] for exact, deployed in runs if first_best(exact) != first_best(deployed)
            ]
            largest_margin = max(margins, default=0)
            # Nothing is reversed if the safe margin is 0.
            overturned.see(float(largest_margin / safe) if largest_margin else 0.0, case.name, len(runs))
    yield most.finding()
    yield overturned.finding()


def _leads(seeds: range) -> Finding:
    # Half a step for the bias and each input's row, twice, for two classes; plus the error of doubles on the way. As a
    # share of n + 1 steps, which is the same for all of these tables.
    cases = list(_tables(seeds))
    slack = max(2 * float_slack(case.tables, case.integers.scale) for case in cases)
    worst = Worst("lead lost in the worst frame, 4 to 16 bits", "half a step an input", _N + 1 + slack, "steps")
    for case in cases:
        worst.see(float(Rounding(case.tables, case.integers).worst_of_all().loss), case.name)
    return worst.finding()


def _half_steps(full: bool) -> Finding:
    # The bound is attained: every row is exactly half a step off, in opposite directions for the two classes.
    worst = Worst("all rows half a step off", "half a step an input, exactly", 0, "steps")
    for switches, width in ((1, 4), (1, 16), (2, 8), (31, 8), (MAX_SWITCHES if full else 256, 16)):
        case = quantised(f"{switches} switches, {width} bits", half_a_step_off(switches, 2 ** (width - 1) - 1), width)
        loss = Rounding(case.tables, case.integers).worst_of_all().loss
        worst.see(float(abs(loss - (switches + 1))), case.name)
    return worst.finding()


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
