"""Lines of joints and pairs of joints, alone and beside bins, from score tables to integers."""

from collections.abc import Callable
from fractions import Fraction
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from thenar.compiler.model.compare import compare, worst_case
from thenar.runtime.errors import BuildError
from thenar.runtime.model.integers import LIMIT, IntegerTables, tables_from_bytes, tables_to_bytes
from thenar.runtime.model.proof import Rounding
from thenar.runtime.model.quantise import as_deployed, balance, quantise
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.grid import Grid
from thenar.runtime.model.terms.line import Line
from thenar.runtime.scores import LANE_OFFSET, Scorer

from .conftest import UNIT, exact_scores, lost_in_parts

Drawn = tuple[ScoreTables, np.ndarray, np.ndarray]
Make = Callable[[int], Drawn]


def with_lines(
    seed: int, joints: int = 3, switches: int = 4, classes: int = 4, widest: int = 3000, narrowest: int = 1
) -> Drawn:
    """Return tables of which joints have bins, a line or both, and rows of them, for `narrowest` to `widest` codes."""
    random = np.random.default_rng(seed)
    thresholds, rows, lines = [], [], []
    size = 10.0 ** random.uniform(-2, 2)
    for joint in range(joints):
        bins = int(random.integers(0, 4))
        steps = np.sort(random.choice(600, bins, replace=False)).astype(np.uint16)
        thresholds.append(steps)
        rows.append(size * random.normal(size=(bins + 1, classes)) * (bins > 0))
        if bins < 2 or random.random() < 0.5:
            low, span = int(random.integers(0, 300)), int(np.exp(random.uniform(*np.log([narrowest, widest]))))
            row = size * random.normal(size=classes) * 10 ** random.uniform(-1, 1) / max(span, 1)
            lines.append(Line(joint, low, low + max(span, 1), row))
    bias, of_switches = size * random.normal(size=classes), size * random.normal(size=(switches, classes))
    tables = ScoreTables.of(bias, of_switches, thresholds, rows, lines)
    codes = random.integers(0, 700, (40, joints)).astype(np.uint16)
    codes[random.random(codes.shape) < 0.1] = 65535
    return tables, random.random((40, switches)) < 0.5, codes


def _steps(random: np.random.Generator, most: int) -> np.ndarray:
    return np.sort(random.choice(40, int(random.integers(0, most)), replace=False)).astype(np.uint16)


def with_pairs(seed: int, joints: int = 5, switches: int = 3) -> Drawn:
    """Return tables of which joints have bins of their own, are in a pair or both, and rows of them."""
    random = np.random.default_rng(seed)
    size, pairs = 10.0 ** random.uniform(-2, 2), []
    order = random.permutation(joints).tolist()
    for a, b in sorted(sorted(order[at : at + 2]) for at in range(0, joints - joints % 2, 2)):
        one, other = _steps(random, 4), _steps(random, 4)
        rows = size * random.normal(size=(len(one) + 1, len(other) + 1, 4))
        pairs.append(Grid((a, b), (one, other), rows))
    thresholds = tuple(_steps(random, 4) for _ in range(joints))
    own = tuple(size * random.normal(size=(len(steps) + 1, 4)) for steps in thresholds)
    bias, rows = size * random.normal(size=4), size * random.normal(size=(switches, 4))
    codes = random.integers(0, 45, (40, joints)).astype(np.uint16)
    return ScoreTables.of(bias, rows, thresholds, own, pairs), random.random((40, switches)) < 0.5, codes


EACH = pytest.mark.parametrize("make", [with_lines, with_pairs])
seeds = st.integers(0, 10_000)
entries = st.sampled_from([8, 16])


@EACH
@given(seed=seeds, entry_bits=entries)
def test_integers_keep_their_bounds_on_every_row_and_are_read_again(make: Make, seed: int, entry_bits: int) -> None:
    tables, bits, codes = make(seed)
    integers = quantise(tables, bits, codes, entry_bits=entry_bits)
    comparison = compare(tables, integers, bits, codes)
    assert comparison.holds
    assert integers.bound <= LIMIT
    scores = integers.scores(bits, codes)
    exact = exact_scores(tables, bits[:5], codes[:5])
    exact = exact - exact[:, -1:] if integers.grid > 1 else exact
    for wanted, found in zip(exact.ravel().tolist(), scores[:5].ravel().tolist(), strict=True):
        assert abs(wanted * UNIT * Fraction(integers.scale) - found) <= comparison.integer_bound + comparison.slack
    worst = worst_case(tables, integers, comparison, [*"abcd"], [*"stuv"[: bits.shape[1]]])
    assert worst.holds
    assert abs(worst.reach) == integers.bound
    data = tables_to_bytes(integers)
    again = tables_from_bytes(data)
    assert tables_to_bytes(again) == data
    assert (again.scores(bits, codes) == scores).all()


SMALL = {
    "short lines": lambda seed: with_lines(seed, joints=1, switches=1, classes=3, widest=30),
    "lines": lambda seed: with_lines(seed, joints=1, switches=1, classes=3, widest=700),
    "lines whose codes share distances": lambda seed: with_lines(seed, 1, 1, 3, widest=790, narrowest=300),
    "pairs": lambda seed: with_pairs(seed, joints=2, switches=0),
}


@pytest.mark.parametrize("kind", SMALL)
@settings(deadline=None, max_examples=12)
@given(seed=seeds, entry_bits=entries)
@example(seed=7, entry_bits=8)  # the last of the codes that share a distance with the end of a bin loses most
def test_of_all_codes_none_loses_more_and_the_witness_as_much(kind: str, seed: int, entry_bits: int) -> None:
    tables, bits, codes = SMALL[kind](seed)
    integers = quantise(tables, bits, codes, entry_bits=entry_bits)
    rounding = Rounding(tables, integers)
    of_a_joint = range(43) if tables.grids else range(1100)
    frames = list(product((False, True), repeat=bits.shape[1]))
    at = np.array(list(product(of_a_joint, repeat=codes.shape[1])), np.uint16)
    whole = np.repeat(np.array(frames, bool).reshape(len(frames), -1), len(at), axis=0)
    every, parts = lost_in_parts(tables, integers, whole, np.tile(at, (len(frames), 1)))
    for leader, competitor in permutations(range(integers.n_classes), 2):
        worst = rounding.worst(leader, competitor)
        assert worst.loss == Fraction(max(every[:, leader] - every[:, competitor]), parts)
        own, _ = lost_in_parts(tables, integers, worst.bits[np.newaxis], worst.codes[np.newaxis])
        assert worst.loss == Fraction(own[0, leader] - own[0, competitor], parts)


@given(seed=seeds)
def test_the_runtime_sums_as_arrays_do_without_lost_inputs(seed: int) -> None:
    tables, bits, codes = with_lines(seed)
    integers = quantise(tables, bits, codes)
    scorer, scores = Scorer(integers), integers.scores(bits, codes)
    lost = np.arange(integers.n_joints) % 2 == seed % 2
    for row in range(len(bits)):
        assert (np.array(scorer.biased_scores(bits[row], codes[row])) - LANE_OFFSET == scores[row]).all()
        left = np.array(scorer.biased_scores(bits[row], codes[row], np.zeros(4, bool), lost)) - LANE_OFFSET
        for joint in np.flatnonzero(lost).tolist():
            mine = integers.joint_rows[joint][np.searchsorted(integers.thresholds[joint], codes[row, joint])].astype(
                int
            )
            slopes = (slope for slope in integers.lines if slope.joint == joint)
            mine = mine + sum(slope.of(codes[row : row + 1, joint])[0] for slope in slopes)
            left += mine - integers.joint_means[joint]
        assert (left == scores[row]).all()


@given(seed=seeds)
def test_rows_of_a_byte_are_upper_halves_of_steps_and_no_coarser(seed: int) -> None:
    tables, bits, codes = with_lines(seed)
    if not tables.lines:
        return
    coarse, fine = (quantise(tables, bits, codes, entry_bits=entry) for entry in (8, 16))
    assert coarse.grid == 256
    assert coarse.relative  # to a last class: the furthest score is up to twice as far
    assert coarse.scale <= 4 * fine.scale
    assert fine.scale <= 8 * coarse.scale


@given(seed=seeds)
def test_the_bias_compensates_the_mean_rounding_of_upper_halves(seed: int) -> None:
    tables, bits, codes = with_lines(seed)
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
    tables = ScoreTables.of(np.zeros(2), np.zeros((0, 2)), (no,), (np.zeros((1, 2)),), (Line(0, 10, 14, row),))
    bits, codes = np.zeros((5, 0), bool), np.arange(10, 15, dtype=np.uint16)[:, np.newaxis]
    integers = quantise(tables, bits, codes)
    (slope,) = integers.lines
    assert slope.most == 4 << slope.shift > 127
    scores = integers.scores(bits, codes)
    assert (np.diff(scores, axis=0) == np.diff(scores, axis=0)[0]).all()
    assert scores[:, 0].tolist() == (-scores[:, 1]).tolist()


JOINTS = 5


@settings(deadline=None, max_examples=40)
@given(seed=seeds)
def test_a_missing_joint_adds_its_mean_and_gives_pairs_code_0(seed: int) -> None:
    tables, bits, codes = with_pairs(seed)
    integers = quantise(tables, bits, codes)
    scorer, scores = Scorer(integers), integers.scores(bits, codes)
    lost = np.random.default_rng(seed).random(JOINTS) < 0.5
    for row in range(len(bits)):
        assert (np.array(scorer.biased_scores(bits[row], codes[row])) - LANE_OFFSET == scores[row]).all()
        asked = np.where(lost, 0, codes[row]).astype(np.uint16)[np.newaxis]
        meant = integers.scores(bits[row : row + 1], asked)[0]
        for joint in np.flatnonzero(lost).tolist():
            meant = meant + integers.joint_means[joint] - integers.joint_rows[joint][0]
        left = np.array(scorer.biased_scores(bits[row], codes[row], np.zeros(3, bool), lost)) - LANE_OFFSET
        assert (left == meant).all()
        assert np.abs(left).max() <= integers.bound
    every = np.ones(JOINTS, bool)
    for held in (None, tuple(codes[0].tolist())):
        none = scorer.biased_scores([False] * 3, codes[0], [False] * 3, every if held is None else ~every)
        assert scorer.state_scores(0, 0, held) == none


@settings(deadline=None, max_examples=25)
@given(seed=seeds, entry_bits=entries)
def test_the_bound_is_what_the_worst_of_all_frames_reaches(seed: int, entry_bits: int) -> None:
    tables, bits, codes = with_pairs(seed, joints=3, switches=1)
    integers = quantise(tables, bits, codes, entry_bits=entry_bits)
    each = [[*np.unique(np.append(0, integers.steps_of(joint) + 1)).tolist(), None] for joint in range(3)]
    reached = 0
    for frame in product(*each):
        own = [
            integers.joint_means[a]
            if code is None
            else integers.joint_rows[a][np.searchsorted(integers.thresholds[a], code)]
            for a, code in enumerate(frame)
        ]
        own += [pair.of(*(np.array([frame[joint] or 0]) for joint in pair.joints))[0] for pair in integers.grids]
        for switch in (0 * integers.bias, integers.switch_rows[0], integers.switch_means[0]):
            terms = np.stack([integers.bias, switch, *own]).astype(int)
            reached = max(reached, int(np.maximum(terms, 0).sum(0).max()), int(np.maximum(-terms, 0).sum(0).max()))
    assert integers.bound == reached


def _whole(*pairs: Grid) -> IntegerTables:
    none, no = np.zeros((0, 2), np.int16), np.zeros(0, np.uint16)
    rows = (np.zeros((1, 2), np.int16),) * 4
    return IntegerTables.of(np.zeros(2, np.int16), none, (no,) * 4, rows, none, np.zeros((4, 2), np.int16), 1.0, pairs)


def _pair(a: int, b: int, steps: tuple[int, ...] = (3,), rows: int = 2) -> Grid:
    return Grid((a, b), (np.array(steps, np.uint16), np.array([5], np.uint16)), np.zeros((rows, 2, 2), np.int16))


@pytest.mark.parametrize(
    ("pairs", "because"),
    [
        ([_pair(0, 1), _pair(1, 2)], "in one grid at most"),
        ([_pair(1, 0)], "in one grid at most"),
        ([_pair(0, 4)], "below 4"),
        ([_pair(2, 3), _pair(0, 1)], "must rise"),
        ([_pair(0, 1, (3, 3), 3)], "strictly increasing"),
        ([_pair(0, 1, (3, 4))], "it must be int16"),
    ],
)
def test_pairs_that_make_no_sense_are_refused(pairs: list[Grid], because: str) -> None:
    with pytest.raises(BuildError, match=because):
        _whole(*pairs)


def test_the_bytes_of_a_pair_are_as_documented() -> None:
    rows = np.arange(4, dtype=np.int16).reshape(2, 1, 2)
    pair = Grid((1, 3), (np.array([258], np.uint16), np.zeros(0, np.uint16)), rows)
    data, without = (tables_to_bytes(_whole(*pairs))[56:] for pairs in ([pair], []))
    assert data[6] == 1
    assert data[8 : len(without)] == without[8:]
    own = [1, 0, 3, 0, 1, 0, 0, 0, 2, 1, 0, 0, 1, 0, 2, 0, 3, 0]
    assert list(data[len(without) :]) == own
