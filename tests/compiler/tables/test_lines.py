"""Lines of joints, alone and beside bins, from score tables to integers."""

from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.tables.collapse import Line, ScoreTables
from thenar.compiler.tables.compare import compare, worst_case
from thenar.compiler.tables.furthest import furthest
from thenar.compiler.tables.quantise import as_deployed, balance, integer_scores, quantise, reach
from thenar.compiler.tables.worstcase import Rounding
from thenar.runtime.scores import LANE_OFFSET, Scorer
from thenar.runtime.tables import LIMIT, tables_from_bytes, tables_to_bytes

seeds = st.integers(0, 10_000)
entries = st.sampled_from([8, 16])


def _made(
    seed: int, joints: int = 3, switches: int = 4, classes: int = 4, widest: int = 3000
) -> tuple[ScoreTables, np.ndarray, np.ndarray]:
    """Tables of which joints have bins, a line or both, and rows of them; ranges of 1 to `widest` codes."""
    random = np.random.default_rng(seed)
    thresholds, rows, lines = [], [], []
    size = 10.0 ** random.uniform(-2, 2)
    for joint in range(joints):
        bins = int(random.integers(0, 4))
        steps = np.sort(random.choice(600, bins, replace=False)).astype(np.uint16)
        thresholds.append(steps)
        rows.append(size * random.normal(size=(bins + 1, classes)) * (bins > 0))
        if bins < 2 or random.random() < 0.5:
            low, span = int(random.integers(0, 300)), int(np.exp(random.uniform(0, np.log(widest))))
            row = size * random.normal(size=classes) * 10 ** random.uniform(-1, 1) / max(span, 1)
            lines.append(Line(joint, low, low + max(span, 1), row))
    tables = ScoreTables(
        size * random.normal(size=classes),
        size * random.normal(size=(switches, classes)),
        tuple(thresholds),
        tuple(rows),
        tuple(lines),
    )
    codes = random.integers(0, 700, (40, joints)).astype(np.uint16)
    codes[random.random(codes.shape) < 0.1] = 65535
    return tables, random.random((40, switches)) < 0.5, codes


def _exact(tables: ScoreTables, bits: np.ndarray, codes: np.ndarray) -> list[Fraction]:
    sums = [Fraction(each) for each in tables.bias.tolist()]
    added = [row.tolist() for row, closed in zip(tables.switch_rows, bits, strict=True) if closed]
    for steps, rows, code in zip(tables.thresholds, tables.joint_rows, codes.tolist(), strict=True):
        added.append(rows[int((steps < code).sum())].tolist())
    for row in added:
        sums = [total + Fraction(each) for total, each in zip(sums, row, strict=True)]
    for line in tables.lines:
        above = min(max(int(codes[line.joint]), line.low), line.high) - line.low
        sums = [total + above * Fraction(each) for total, each in zip(sums, line.row.tolist(), strict=True)]
    return sums


@settings(deadline=None)
@given(seed=seeds, entry_bits=entries)
def test_integers_keep_their_bounds_on_every_row(seed: int, entry_bits: int) -> None:
    tables, bits, codes = _made(seed)
    integers = quantise(tables, bits, codes, entry_bits=entry_bits)
    comparison = compare(tables, integers, bits, codes)
    assert comparison.holds
    assert integers.bound <= LIMIT
    for row in range(5):
        exact = _exact(tables, bits[row], codes[row])
        exact = [x - exact[-1] for x in exact] if integers.grid > 1 else exact
        steps = integer_scores(integers, bits[row : row + 1], codes[row : row + 1])[0].tolist()
        most = max(abs(x * Fraction(integers.scale) - n) for x, n in zip(exact, steps, strict=True))
        assert most <= comparison.integer_bound + comparison.slack
    worst = worst_case(tables, integers, comparison, [*"abcd"], [*"stuv"])
    assert worst.holds
    assert abs(worst.reach) == integers.bound


@settings(deadline=None)
@given(seed=seeds)
def test_the_runtime_adds_up_what_arrays_add_up_and_nothing_of_what_is_lost(seed: int) -> None:
    tables, bits, codes = _made(seed)
    integers = quantise(tables, bits, codes)
    scorer, scores = Scorer(integers), integer_scores(integers, bits, codes)
    lost = np.arange(integers.n_joints) % 2 == seed % 2
    for row in range(len(bits)):
        assert (np.array(scorer.lanes(bits[row], codes[row])) - LANE_OFFSET == scores[row]).all()
        left = np.array(scorer.lanes_without(bits[row], codes[row], np.zeros(4, bool), lost)) - LANE_OFFSET
        for joint in np.flatnonzero(lost).tolist():
            mine = integers.joint_rows[joint][np.searchsorted(integers.thresholds[joint], codes[row, joint])].astype(
                int
            )
            slope = integers.slope_of(joint)
            mine = mine + (0 if slope is None else slope.of(codes[row : row + 1, joint])[0])
            left += mine - integers.joint_means[joint]
        assert (left == scores[row]).all()


@settings(deadline=None)
@given(seed=seeds, entry_bits=entries)
def test_a_frame_and_an_order_reach_the_bound(seed: int, entry_bits: int) -> None:
    tables, bits, codes = _made(seed)
    integers = quantise(tables, bits, codes, entry_bits=entry_bits)
    found = furthest(integers, missing=False)
    reached = found.terms[found.order][: found.n_terms].astype(int).sum(axis=0)[found.grasp]
    assert reached == found.total
    whole = found.terms.astype(int).sum(axis=0)
    assert (whole == integer_scores(integers, found.bits[np.newaxis], found.codes[np.newaxis])[0]).all()
    assert abs(furthest(integers).total) == integers.bound >= abs(found.total)


@settings(deadline=None, max_examples=25)
@given(seed=seeds, entry_bits=entries)
def test_no_partial_sum_of_any_code_leaves_the_bound(seed: int, entry_bits: int) -> None:
    tables, bits, rows = _made(seed, widest=400)
    integers = quantise(tables, bits, rows, entry_bits=entry_bits)
    codes = np.arange(800).astype(np.uint16)
    for sign in (1, -1):
        reached = np.maximum(sign * integers.bias.astype(int), 0)
        reached += (
            np.maximum(sign * np.stack([integers.switch_rows, integers.switch_means]).astype(int), 0).max(0).sum(0)
        )
        for joint, mean in enumerate(integers.joint_means.astype(int)):
            each = np.maximum(sign * integers.joint_rows[joint].astype(int), 0)
            each = each[np.searchsorted(integers.thresholds[joint], codes)]
            if slope := integers.slope_of(joint):
                each = each + np.maximum(sign * slope.of(codes), 0)
            reached += np.maximum(each.max(axis=0), sign * mean)
        assert reached.max() <= integers.bound


@settings(deadline=None, max_examples=20)
@given(seed=seeds, entry_bits=entries, widest=st.sampled_from([30, 700]))
def test_of_all_codes_none_loses_more_and_the_witness_as_much(seed: int, entry_bits: int, widest: int) -> None:
    tables, bits, codes = _made(seed, joints=1, switches=1, classes=3, widest=widest)
    integers = quantise(tables, bits, codes, entry_bits=entry_bits)
    rounding, scale = Rounding(tables, integers), Fraction(integers.scale)

    def errors(frame: np.ndarray, code: int) -> list[Fraction]:
        at = np.array([code], np.uint16)
        steps = integer_scores(integers, frame[np.newaxis], at[np.newaxis])[0].tolist()
        return [scale * x - n for x, n in zip(_exact(tables, frame, at), steps, strict=True)]

    every = {(bit, code): errors(np.array([bit]), code) for bit in (False, True) for code in range(1100)}
    for leader, competitor in permutations(range(3), 2):
        worst = rounding.worst(leader, competitor)
        assert worst.loss == max(each[leader] - each[competitor] for each in every.values())
        own = errors(worst.bits, int(worst.codes[0]))
        assert worst.loss == own[leader] - own[competitor]


@settings(deadline=None)
@given(seed=seeds, entry_bits=entries)
def test_tables_with_slopes_are_read_again(seed: int, entry_bits: int) -> None:
    tables, bits, codes = _made(seed)
    integers = quantise(tables, bits, codes, entry_bits=entry_bits)
    data = tables_to_bytes(integers)
    again = tables_from_bytes(data)
    assert tables_to_bytes(again) == data
    assert (integer_scores(again, bits, codes) == integer_scores(integers, bits, codes)).all()


@given(seed=seeds)
def test_rows_of_a_byte_are_upper_halves_of_steps_and_no_coarser(seed: int) -> None:
    tables, bits, codes = _made(seed)
    if not tables.lines:
        return
    coarse, fine = (quantise(tables, bits, codes, entry_bits=entry) for entry in (8, 16))
    assert coarse.grid == 256
    assert coarse.relative  # to a last class: the furthest score is up to twice as far
    assert coarse.scale <= 4 * fine.scale
    assert fine.scale <= 8 * coarse.scale


@given(seed=seeds)
def test_of_upper_halves_the_bias_takes_back_what_rounding_takes_in_the_mean(seed: int) -> None:
    tables, bits, codes = _made(seed)
    if not tables.lines:
        return
    integers = quantise(tables, bits, codes, entry_bits=8)
    wanted = as_deployed(tables, integers.grid)
    steps = integers.scale * wanted.switch_rows
    lost = bits.mean(axis=0) @ (steps - integers.switch_rows)
    assert np.abs(steps - integers.switch_rows).max(initial=0) <= 128
    assert np.allclose(balance(wanted).bias * integers.scale + lost, integers.bias, rtol=0, atol=0.51)


def test_a_line_of_few_codes_and_much_weight_takes_a_gain() -> None:
    row = np.array([1.0, -1.0])
    no = np.array([], np.uint16)
    tables = ScoreTables(np.zeros(2), np.zeros((0, 2)), (no,), (np.zeros((1, 2)),), (Line(0, 10, 14, row),))
    bits, codes = np.zeros((5, 0), bool), np.arange(10, 15, dtype=np.uint16)[:, np.newaxis]
    integers = quantise(tables, bits, codes)
    (slope,) = integers.slopes
    assert slope.most == 4 << slope.gain > 127
    scores = integer_scores(integers, bits, codes)
    assert (np.diff(scores, axis=0) == np.diff(scores, axis=0)[0]).all()
    assert scores[:, 0].tolist() == (-scores[:, 1]).tolist()


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_the_unit_of_scores_does_not_matter(factor: float) -> None:
    tables, bits, codes = _made(7)
    lines = tuple(Line(line.joint, line.low, line.high, line.row * factor) for line in tables.lines)
    rows = tuple(rows * factor for rows in tables.joint_rows)
    other = ScoreTables(tables.bias * factor, tables.switch_rows * factor, tables.thresholds, rows, lines)
    assert reach(other, 1.0, rounded=False) == pytest.approx(factor * reach(tables, 1.0, rounded=False))
    one, two = (quantise(each, bits, codes) for each in (tables, other))
    assert two.scale == pytest.approx(one.scale / factor, rel=1e-2)
