"""Quantisation of scores to integers of 4 to 16 bits, in the worst possible frame."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import permutations, product

import numpy as np
from mpmath import mpf

from thenar.compiler.tables.collapse import ScoreTables
from thenar.compiler.tables.compare import float_slack
from thenar.compiler.tables.furthest import furthest
from thenar.compiler.tables.quantise import balance
from thenar.compiler.tables.worstcase import Rounding
from thenar.runtime.errors import BuildError
from thenar.runtime.scores import LANE_OFFSET, Scorer
from thenar.runtime.tables import (
    LIMIT,
    MAX_CLASSES,
    MAX_JOINTS,
    MAX_SWITCHES,
    IntegerTables,
    tables_from_bytes,
    tables_to_bytes,
)

from ..finding import Case, Finding, Worst
from ..inputs.hard_tables import (
    Quantised,
    dominated,
    drawn,
    every_frame,
    first_best,
    half_a_step_off,
    largest_sum,
    quantised,
    rows_of,
    sized,
    whole_numbers,
)
from ..inputs.small_sets import small_build, small_set
from ..reference.numbers import precisely, ratio
from ..reference.tables import steps, table_scores


class BothWays:
    """Tables and their integers, prepared for one frame after another."""

    def __init__(self, tables: ScoreTables, integers: IntegerTables) -> None:
        self._scorer, self._scale = Scorer(integers), integers.scale
        self._rows = (
            tables.bias.tolist(),
            tables.switch_rows.tolist(),
            [thresholds.tolist() for thresholds in tables.thresholds],
            [rows.tolist() for rows in tables.joint_rows],
        )

    @precisely()
    def run(self, bits: Sequence[bool], codes: Sequence[int]) -> tuple[list[mpf], list[int]]:
        """Return the frame's scores (K,) in steps: exact, and from the integer tables."""
        exact = [score * self._scale for score in table_scores(*self._rows, bits, codes)]
        return exact, [lane - LANE_OFFSET for lane in self._scorer.lanes(bits, codes)]


@precisely()
def lost(exact: Sequence[mpf], deployed: Sequence[int], leader: int, other: int) -> mpf:
    """Return the lost steps of the lead of class `leader` over `other`."""
    return (exact[leader] - exact[other]) - (deployed[leader] - deployed[other])


# The rows that can add the last step to a sum, and their arrays.
LAST = (
    ("the bias", "bias"),
    ("a closed switch", "switch_rows"),
    ("a missing switch", "switch_means"),
    ("a bin", "joint_rows"),
    ("a missing joint", "joint_means"),
)


def edges(full: bool) -> Iterator[Finding]:
    """Check tables whose sums reach 32767, and those that reach 32768 by each possible row."""
    right = Worst("sums of exactly +-32767", "accepted, and summed without overflow", 0, "tables")
    wrong = Worst("sums of 32768", "rejected, in memory and as a file", 0, "tables")
    for sign, classes, (name, arrays) in product((1, -1), (2, 3, MAX_CLASSES if full else 33), LAST):
        tables = edge_tables(classes, sign, arrays)
        at = f"{classes} classes, {'+' if sign > 0 else '-'} by {name}"
        right.see(float(not _is_right(tables, sign)), at)
        wrong.see(float(not _is_refused(tables, arrays, sign)), at)
    yield right.finding()
    yield wrong.finding()


def edge_tables(classes: int, sign: int, last: str) -> IntegerTables:
    """Return tables of one switch and one joint in which class 1 reaches 32767 steps by the row in `last`.

    Its neighbours reach as far in the other direction, so that an overflow into the next lane would show.
    """
    arrays = {name: np.zeros((1, classes), np.int16) for _, name in LAST}
    towards = np.full(classes, -sign)
    towards[1] = sign
    arrays["bias"][0] = towards * (LIMIT - 1)
    arrays[last][0] += towards.astype(np.int16)
    return IntegerTables(
        bias=arrays["bias"][0],
        switch_rows=arrays["switch_rows"],
        thresholds=(np.array([100], np.uint16),),
        joint_rows=(np.vstack([arrays["joint_rows"], 0 * towards]).astype(np.int16),),
        switch_means=arrays["switch_means"],
        joint_means=arrays["joint_means"],
        scale=1.0,
    )


def _is_right(tables: IntegerTables, sign: int) -> bool:
    read = tables_from_bytes(tables_to_bytes(tables))
    found = furthest(read)
    lanes = Scorer(read).lanes_without(found.bits, found.codes, found.lost_switches, found.lost_joints)
    expected = [LANE_OFFSET + (LIMIT if k == 1 else -LIMIT) * sign for k in range(tables.n_classes)]
    return read.bound == LIMIT and list(lanes) == expected


def _is_refused(tables: IntegerTables, last: str, sign: int) -> bool:
    row = tables.joint_rows[0] if last == "joint_rows" else getattr(tables, last)
    if last == "bias" and sign > 0:
        row = tables.switch_rows  # 32768 does not fit int16: the extra step comes from another row
    row[..., 1].flat[0] += sign
    altered = tables_to_bytes(tables)
    return _refuses(lambda: replace(tables)) and _refuses(lambda: tables_from_bytes(altered))


def _refuses(make: Callable[[], IntegerTables]) -> bool:
    try:
        make()
    except BuildError:
        return True
    return False


def largest(full: bool) -> Finding:
    """Compare the scores of the largest tables with 64-bit sums."""
    worst = Worst("scores by the largest tables that fit in a file", "sums of 64 bits", 0, "scores")
    random = np.random.default_rng(7)
    sizes: list[tuple[int, int, tuple[int, ...]]] = [
        (2, MAX_SWITCHES, ()),
        (2, 0, (65536,)),
        (MAX_CLASSES, 0, (31,) * 250),
        (2, MAX_SWITCHES, (6,) * MAX_JOINTS),
    ]
    if full:
        sizes.append((MAX_CLASSES, MAX_SWITCHES - 1, ()))
    for classes, switches, bins in sizes:
        tables = tables_from_bytes(tables_to_bytes(_filled(whole_numbers(7, classes, switches, bins, 6))))
        bits = random.random(switches) < 0.5
        codes = random.integers(0, 65536, len(bins)).astype(np.uint16)
        rows = [tables.bias.astype(np.int64), tables.switch_rows[bits].sum(axis=0, dtype=np.int64)]
        joints = zip(tables.thresholds, tables.joint_rows, codes, strict=True)
        rows += [steps[np.searchsorted(thresholds, code)].astype(np.int64) for thresholds, steps, code in joints]
        scores = np.array(Scorer(tables).lanes(bits, codes)) - LANE_OFFSET
        differ = int(np.count_nonzero(scores != np.sum(rows, axis=0))) + int(tables.bound != LIMIT)
        worst.see(differ, f"{classes} classes, {switches} switches, {sum(bins)} bins", classes)
    return worst.finding()


def _filled(tables: IntegerTables) -> IntegerTables:
    """Return the tables with a bias for which the furthest of all sums is 32767."""
    silent = replace(tables, bias=0 * tables.bias)
    found = furthest(silent)
    bias = tables.bias * 0
    bias[found.grasp] = np.sign(found.total) * (LIMIT - abs(found.total))
    return replace(tables, bias=bias)


# Products of a row and the scale are doubles with a relative error of 2^-53, so the scale at which one passes half a
# step has the same error, at most one unit in its last place; the next double adds another.
_BOUND = 2


def finest_scales(seeds: range) -> Finding:
    """Compare the compiler's scale with the finest, for similar classes and for one that dominates by up to 10^12."""
    worst = Worst("scale, one class up to 10^12 times the others", "bisection in exact arithmetic", _BOUND, "ulp")
    for seed in seeds:
        for width, factor in ((4, 1.0), (16, 1.0), (8, 1e3), (16, 1e-3), (16, 1e6), (16, 1e12)):
            tables = dominated(seed, 3, 4, (5, 3), factor)
            worst.see(_error(tables, width), f"draw {seed}, {width} bits, times {factor:g}")
        worst.see(_error(drawn(seed, 2, 1, ()), 16), f"draw {seed}, 2 classes, 1 switch")
    return worst.finding()


def _error(tables: ScoreTables, width: int) -> float:
    got, limit = quantised("", tables, width).integers.scale, 2 ** (width - 1) - 1
    finest = _finest(balance(tables), limit)
    return abs(got - finest) / math.ulp(finest)


def _finest(tables: ScoreTables, limit: int) -> float:
    """Return the largest scale at which sums of rows, rounded half to even from exact products, stay within limit."""
    inputs = rows_of(tables)
    fits, too_fine = 0.0, 1.0
    while _furthest(inputs, too_fine) <= limit:
        fits, too_fine = too_fine, 2 * too_fine
    while (middle := (fits + too_fine) / 2) not in (fits, too_fine):
        fits, too_fine = (middle, too_fine) if _furthest(inputs, middle) <= limit else (fits, middle)
    return fits


def _furthest(inputs: list[list[list[float]]], scale: float) -> float:
    return largest_sum([[[steps(value, scale) for value in row] for row in rows] for rows in inputs])


CASE = Case(
    title="Integers of 4 to 16 bits",
    danger="rounding changes a score more than guaranteed, or a sum overflows",
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
    yield finest_scales(seeds if full else seeds[:2])
    yield from edges(full)
    yield largest(full)


def _witnesses(seeds: range) -> Finding:
    # Both sides are exact: rows of about 75 bits between their highest and lowest place, times a scale of 53 bits, fit
    # into the 199 bits of 60 digits.
    worst = Worst("worst frame of every pair of classes", "60 digits and the scorer, in that frame", 0, "steps")
    small = small_build(small_set(7, rows=200, switches=24, joints=3, types=6, noise=0.15), rounds=40)
    for case in (Quantised("a compiled build", small.tables, small.build.tables), *_tables(seeds)):
        rounding, both = Rounding(case.tables, case.integers), BothWays(case.tables, case.integers)
        for leader, other in permutations(range(case.integers.n_classes), 2):
            frame = rounding.worst(leader, other)
            exact, deployed = both.run(frame.bits.tolist(), frame.codes.tolist())
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
        both, safe = BothWays(case.tables, case.integers), ratio(rounding.safe_margin())
        runs = [both.run(*frame) for frame in every_frame(case.tables)]
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
