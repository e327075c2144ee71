"""Pairs of joints, besides bins of their own, from score tables to integers."""

from fractions import Fraction
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.tables.collapse import ScoreTables
from thenar.compiler.tables.compare import compare, worst_case
from thenar.compiler.tables.furthest import furthest
from thenar.compiler.tables.quantise import integer_scores, quantise
from thenar.compiler.tables.worstcase import Rounding
from thenar.runtime.errors import BuildError
from thenar.runtime.scores import LANE_OFFSET, LiveScores, Scorer
from thenar.runtime.tables import LIMIT, IntegerTables, Pair, tables_from_bytes, tables_to_bytes

seeds = st.integers(0, 10_000)
entries = st.sampled_from([8, 16])
JOINTS = 5


def _steps(random: np.random.Generator, most: int) -> np.ndarray:
    return np.sort(random.choice(40, int(random.integers(0, most)), replace=False)).astype(np.uint16)


def _made(seed: int, joints: int = JOINTS, switches: int = 3) -> tuple[ScoreTables, np.ndarray, np.ndarray]:
    """Tables of which joints have bins of their own, are in a pair or both, and rows of them."""
    random = np.random.default_rng(seed)
    size, pairs = 10.0 ** random.uniform(-2, 2), []
    order = random.permutation(joints).tolist()
    for a, b in sorted(sorted(order[at : at + 2]) for at in range(0, joints - joints % 2, 2)):
        one, other = _steps(random, 4), _steps(random, 4)
        rows = size * random.normal(size=(len(one) + 1, len(other) + 1, 4))
        pairs.append(Pair((a, b), (one, other), rows))
    thresholds = tuple(_steps(random, 4) for _ in range(joints))
    own = tuple(size * random.normal(size=(len(steps) + 1, 4)) for steps in thresholds)
    bias, rows = size * random.normal(size=4), size * random.normal(size=(switches, 4))
    codes = random.integers(0, 45, (40, joints)).astype(np.uint16)
    return ScoreTables(bias, rows, thresholds, own, (), tuple(pairs)), random.random((40, switches)) < 0.5, codes


def _exact(tables: ScoreTables, bits: np.ndarray, codes: np.ndarray) -> list[Fraction]:
    added = [tables.bias, *(row for row, closed in zip(tables.switch_rows, bits, strict=True) if closed)]
    for steps, rows, code in zip(tables.thresholds, tables.joint_rows, codes.tolist(), strict=True):
        added.append(rows[int((steps < code).sum())])
    for pair in tables.pairs:
        a, b = (int((steps < codes[joint]).sum()) for joint, steps in zip(pair.joints, pair.thresholds, strict=True))
        added.append(pair.rows[a, b])
    return [sum(map(Fraction, column), Fraction(0)) for column in zip(*(row.tolist() for row in added), strict=True)]


@settings(deadline=None, max_examples=40)
@given(seed=seeds, entry_bits=entries)
def test_integers_keep_their_bounds_on_every_row(seed: int, entry_bits: int) -> None:
    tables, bits, codes = _made(seed)
    integers = quantise(tables, bits, codes, entry_bits=entry_bits)
    comparison = compare(tables, integers, bits, codes)
    assert comparison.holds
    assert integers.bound <= LIMIT
    for row in range(5):
        exact = _exact(tables, bits[row], codes[row])
        steps = integer_scores(integers, bits[row : row + 1], codes[row : row + 1])[0].tolist()
        most = max(abs(x * Fraction(integers.scale) - n) for x, n in zip(exact, steps, strict=True))
        assert most <= comparison.integer_bound + comparison.slack
    worst = worst_case(tables, integers, comparison, [*"abcd"], [*"stu"])
    assert worst.holds
    assert abs(worst.reach) == integers.bound


@settings(deadline=None, max_examples=40)
@given(seed=seeds)
def test_a_missing_joint_adds_its_mean_and_is_code_0_to_its_pair(seed: int) -> None:
    tables, bits, codes = _made(seed)
    integers = quantise(tables, bits, codes)
    scorer, scores = Scorer(integers), integer_scores(integers, bits, codes)
    lost = np.random.default_rng(seed).random(JOINTS) < 0.5
    for row in range(len(bits)):
        assert (np.array(scorer.lanes(bits[row], codes[row])) - LANE_OFFSET == scores[row]).all()
        asked = np.where(lost, 0, codes[row]).astype(np.uint16)[np.newaxis]
        meant = integer_scores(integers, bits[row : row + 1], asked)[0]
        for joint in np.flatnonzero(lost).tolist():
            meant = meant + integers.joint_means[joint] - integers.joint_rows[joint][0]
        left = np.array(scorer.lanes_without(bits[row], codes[row], np.zeros(3, bool), lost)) - LANE_OFFSET
        assert (left == meant).all()
        assert np.abs(left).max() <= integers.bound
    live, every = LiveScores(scorer), np.ones(JOINTS, bool)
    for held in (None, tuple(codes[0].tolist()), None):
        live.joints(held)
        none = scorer.lanes_without([False] * 3, codes[0], [False] * 3, every if held is None else ~every)
        assert live.lanes(0) == none


@settings(deadline=None, max_examples=25)
@given(seed=seeds, entry_bits=entries)
def test_the_bound_is_what_the_worst_of_all_frames_reaches(seed: int, entry_bits: int) -> None:
    tables, bits, codes = _made(seed, joints=3, switches=1)
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
        asked = np.array([[code or 0 for code in frame]])
        own += [pair.of(asked)[0] for pair in integers.pairs]
        for switch in (0 * integers.bias, integers.switch_rows[0], integers.switch_means[0]):
            terms = np.stack([integers.bias, switch, *own]).astype(int)
            reached = max(reached, int(np.maximum(terms, 0).sum(0).max()), int(np.maximum(-terms, 0).sum(0).max()))
    assert integers.bound == reached
    found = furthest(integers, missing=False)
    whole = found.terms.astype(int).sum(axis=0)
    assert (whole == integer_scores(integers, found.bits[np.newaxis], found.codes[np.newaxis])[0]).all()
    assert found.terms[found.order][: found.n_terms].astype(int).sum(axis=0)[found.grasp] == found.total


@settings(deadline=None, max_examples=15)
@given(seed=seeds)
def test_of_all_codes_none_loses_more_and_the_witness_as_much(seed: int) -> None:
    tables, bits, codes = _made(seed, joints=2, switches=0)
    integers = quantise(tables, bits, codes)
    rounding, scale = Rounding(tables, integers), Fraction(integers.scale)

    def errors(frame: tuple[int, ...]) -> list[Fraction]:
        at = np.array(frame, np.uint16)
        steps = integer_scores(integers, np.zeros((1, 0), bool), at[np.newaxis])[0].tolist()
        return [scale * x - n for x, n in zip(_exact(tables, np.zeros(0, bool), at), steps, strict=True)]

    every = [errors(frame) for frame in product(np.append(0, np.arange(1, 43)).tolist(), repeat=2)]
    for leader, competitor in permutations(range(4), 2):
        worst = rounding.worst(leader, competitor)
        assert worst.loss == max(each[leader] - each[competitor] for each in every)
        own = errors(tuple(worst.codes.tolist()))
        assert worst.loss == own[leader] - own[competitor]


@settings(deadline=None)
@given(seed=seeds)
def test_tables_with_pairs_are_read_again(seed: int) -> None:
    tables, bits, codes = _made(seed)
    integers = quantise(tables, bits, codes)
    data = tables_to_bytes(integers)
    again = tables_from_bytes(data)
    assert tables_to_bytes(again) == data
    assert (integer_scores(again, bits, codes) == integer_scores(integers, bits, codes)).all()


def _whole(*pairs: Pair) -> IntegerTables:
    none, no = np.zeros((0, 2), np.int16), np.zeros(0, np.uint16)
    rows = (np.zeros((1, 2), np.int16),) * 4
    return IntegerTables(np.zeros(2, np.int16), none, (no,) * 4, rows, none, np.zeros((4, 2), np.int16), 1.0, (), pairs)


def _pair(a: int, b: int, steps: tuple[int, ...] = (3,), rows: int = 2) -> Pair:
    return Pair((a, b), (np.array(steps, np.uint16), np.array([5], np.uint16)), np.zeros((rows, 2, 2), np.int16))


@pytest.mark.parametrize(
    ("pairs", "because"),
    [
        ([_pair(0, 1), _pair(1, 2)], "in one pair at most"),
        ([_pair(1, 0)], "in one pair at most"),
        ([_pair(0, 4)], "below 4"),
        ([_pair(2, 3), _pair(0, 1)], "must rise"),
        ([_pair(0, 1, (3, 3), 3)], "strictly increasing"),
        ([_pair(0, 1, (3, 4))], "it must be int16"),
    ],
)
def test_pairs_that_make_no_sense_are_refused(pairs: list[Pair], because: str) -> None:
    with pytest.raises(BuildError, match=because):
        _whole(*pairs)


def test_the_bytes_of_a_pair_are_as_documented() -> None:
    rows = np.arange(4, dtype=np.int16).reshape(2, 1, 2)
    pair = Pair((1, 3), (np.array([258], np.uint16), np.zeros(0, np.uint16)), rows)
    data, without = (tables_to_bytes(_whole(*pairs))[56:] for pairs in ([pair], []))
    assert data[6] == 1
    assert data[8 : len(without)] == without[8:]
    own = [1, 0, 3, 0, 1, 0, 0, 0, 2, 1, 0, 0, 1, 0, 2, 0, 3, 0]
    assert list(data[len(without) :]) == own
