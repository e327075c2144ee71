from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.model.collapse import _contributions, _joint, collapse
from thenar.compiler.trainers.stumps import Stumps, centred, spread
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import CoreTerm, Term
from thenar.runtime.model.terms.bins import Bins
from thenar.runtime.model.terms.line import Line

from ...conftest import peak_bytes
from .conftest import make_rows, make_stumps


@given(
    seed=st.integers(0, 10_000),
    rounds=st.integers(0, 30),
    classes=st.integers(2, 5),
    switches=st.integers(0, 5),
    joints=st.integers(0, 3),
    shrinkage=st.sampled_from([1.0, 0.1]),
)
def test_tables_score_as_stumps_do(
    seed: int, rounds: int, classes: int, switches: int, joints: int, shrinkage: float
) -> None:
    if switches + joints == 0:
        switches = 1
    stumps = make_stumps(seed, rounds, classes, switches, joints, shrinkage)
    bits, codes = make_rows(seed, switches=switches, joints=joints)
    expected = stumps.scores(np.hstack([bits, codes]))
    magnitude = shrinkage * np.abs(stumps.values[:, :, :2]).sum()
    assert np.abs(collapse(stumps, switches).scores(bits, codes) - expected).max() <= 1e-12 * magnitude


def _one_stump(column: int, threshold: float) -> Stumps:
    """Class 0's stump looks at `column`; class 1's says nothing."""
    columns = np.array([[column, 0]], np.int32)
    values = np.array([[[-8.0, 4.0, 99.0], [0.0, 0.0, 99.0]]])
    return Stumps(2, columns, np.array([[threshold, 0.5]]), values, 1.0)


def test_a_code_at_the_threshold_goes_left() -> None:
    tables = collapse(_one_stump(1, 7.0), 1)
    assert tables.thresholds[0].tolist() == [7]
    codes = np.array([[6], [7], [8]], np.uint16)
    assert tables.scores(np.zeros((3, 1), bool), codes)[:, 0].tolist() == [-2.0, -2.0, 1.0]


def test_thresholds_between_the_same_two_codes_are_one() -> None:
    first, second = _one_stump(1, 7.25), _one_stump(1, 7.75)
    both = Stumps(
        2,
        np.vstack([first.columns, second.columns]),
        np.vstack([first.thresholds, second.thresholds]),
        np.vstack([first.values, second.values]),
        1.0,
    )
    tables = collapse(both, 1)
    assert tables.thresholds[0].tolist() == [7]
    assert tables.joint_rows[0].tolist() == [[-4.0, 4.0], [2.0, -2.0]]


def test_a_threshold_that_no_code_passes_makes_no_bin() -> None:
    for threshold, score in ((-0.5, 1.0), (65535.0, -2.0), (1e300, -2.0)):
        tables = collapse(_one_stump(1, threshold), 1)
        assert tables.thresholds[0].size == 0
        assert tables.joint_rows[0].tolist() == [[score, -score]]


def test_scores_are_added_row_after_row_and_not_as_the_machine_likes() -> None:
    tables = collapse(make_stumps(3, rounds=200, switches=90, joints=0), 90)
    bits = np.random.default_rng(3).random((50, 90)) < 0.5
    for frame, scores in zip(bits, tables.scores(bits, np.zeros((50, 0), np.uint16)), strict=True):
        expected = tables.bias
        for row in tables.switch_rows[frame]:
            expected = expected + row
        assert scores.tobytes() == expected.tobytes()


def test_contributions_at_one_threshold_are_added_in_the_order_of_the_rounds() -> None:
    # However sorting treats equal thresholds: some processors' fastest way does not keep their order.
    random = np.random.default_rng(8)
    rounds = 400
    thresholds = np.array(random.integers(0, 3, (rounds, 2)) + 0.5, np.float64)
    stumps = Stumps(1, np.zeros((rounds, 2), np.int32), thresholds, random.normal(0, 1e3, (rounds, 2, 3)), 1.0)
    order = np.argsort(thresholds.ravel(), kind="mergesort")
    left, right = (_contributions(stumps, side)[:, order] for side in (0, 1))
    by_threshold = _joint(np.floor(thresholds.ravel())[order], left, right, np.tile([0, 1], rounds)[order], 2)
    assert collapse(stumps, 0).joint_rows[0].tobytes() == by_threshold[1].tobytes()


def test_a_stump_adds_exactly_its_centred_answer() -> None:
    random = np.random.default_rng(3)
    values = np.concatenate([random.normal(0, 2, 40), [0.0, -0.0, 5e-324, -5e-324, 3.0, -3.0]])
    for n_classes, shrinkage in ((2, 1.0), (3, 0.1), (33, 1.0)):
        own, others = spread(values, n_classes, shrinkage)
        for value, mine, other in zip(values, own, others, strict=True):
            alone = centred(np.array([[value], *[[0.0 * value]] * (n_classes - 1)]), shrinkage)[:, 0]
            assert alone.tobytes() == np.array([mine, *[other] * (n_classes - 1)]).tobytes()


def test_a_thousand_classes_are_collapsed_without_every_stump_writing_to_every_class() -> None:
    random = np.random.default_rng(4)
    stumps = Stumps(9, random.integers(0, 9, (10, 1000)).astype(np.int32), random.random((10, 1000)),
                    random.normal(0, 1, (10, 1000, 3)), 1.0)  # fmt: skip
    assert (
        peak_bytes(lambda: collapse(stumps, 9)) < 10 * 1000**2
    )  # written out, the answers of one branch alone are 80 MB


@dataclass(frozen=True, eq=False)
class Ramp(Term):
    """A step at a code, and a line from there: one of the four kinds alone does not say this."""

    name = "ramp"

    joint: np.ndarray
    start: np.ndarray
    rows: np.ndarray

    @property
    def inputs(self) -> tuple[int, ...]:
        return (int(self.joint),)

    def of(self, *values: np.ndarray) -> np.ndarray:
        above = np.clip(values[0].astype(int) - int(self.start), 0, 65535 - int(self.start))[:, np.newaxis]
        scores: np.ndarray = (above > 0) * self.rows[0] + above * self.rows[1]
        return scores

    def core(self) -> tuple[CoreTerm, ...]:
        joint, start = int(self.joint), int(self.start)
        step = Bins(joint, np.array([start], np.uint16), np.stack([0 * self.rows[0], self.rows[0]]))
        return Line(joint, start, 65535, self.rows[1]), step


@given(seed=st.integers(0, 10_000))
def test_a_term_of_another_kind_becomes_the_terms_of_its_core(seed: int) -> None:
    random, (bits, codes) = np.random.default_rng(seed), make_rows(seed)
    plain = collapse(make_stumps(seed), 6)
    ramps = [
        Ramp(np.array(joint), np.array(random.integers(0, 300)), random.normal(size=(2, 4)) * [[1.0], [0.01]])
        for joint in random.permutation(3)[:2].tolist()
    ]
    model = ScoreTables(plain.bias, (*plain.terms, *ramps))
    tables = collapse(model, 6)
    assert [line.joint for line in tables.lines] == sorted(ramp.inputs[0] for ramp in ramps)
    assert tables.n_joints == 3
    assert model.magnitude > 0
    assert np.abs(tables.scores(bits, codes) - model.scores(bits, codes)).max() <= 1e-12 * model.magnitude
    with pytest.raises(ValueError, match="collapse them first"):
        quantise(model, bits, codes)
    assert quantise(tables, bits, codes).lines
