"""Tables of pairs of joints: scikit-learn's answer on the same design, and what joints say only together."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag
from sklearn.linear_model import LogisticRegression

from thenar.compiler.samples import TrainingError
from thenar.compiler.trainers.base import TRAINERS
from thenar.compiler.trainers.logit import fit_logit
from thenar.compiler.trainers.newton import BIAS_SHARE, BIN_SHARE
from thenar.compiler.trainers.pairs import fit_pairs
from thenar.runtime.model.tables import ScoreTables

SEEDS = st.integers(0, 2**32 - 1)
FIXED: dict[str, Any] = {"penalty": 0.5, "smoothness": 2.0, "max_bins": 6}


def grasps(seed: int, n: int = 80) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Three types, of which two are apart by whether joints 1 and 2 lie on the same side."""
    random = np.random.default_rng(seed)
    codes = random.integers(0, 60, (n, 4)).astype(np.uint16)
    labels = np.where(codes[:, 0] > 45, 2, (codes[:, 1] > 30) ^ (codes[:, 2] > 30))
    return random.random((n, 2)) < 0.5, codes, labels.astype(np.intp)


def numbers(tables: ScoreTables) -> bytes:
    pairs = (part for pair in tables.grids for part in (*pair.thresholds, pair.rows))
    parts = (tables.bias, tables.switch_rows, *tables.thresholds, *tables.joint_rows, *pairs)
    return b"".join(part.tobytes() for part in parts)


@given(SEEDS)
@settings(max_examples=8, deadline=None)
def test_it_is_scikit_learns_answer_on_the_expanded_design(seed: int) -> None:
    switches, codes, labels = grasps(seed)
    tables = fit_pairs(switches, codes, labels, 3, **FIXED, pairs=2, pair_bins=4, pair_smoothness=0.7, tolerance=1e-11)
    pull, parts = FIXED["penalty"], [np.ones((len(codes), 1)), switches]
    penalties = [np.array([[BIAS_SHARE * pull]]), pull * np.eye(2)]

    def steps(count: int) -> np.ndarray:
        apart = np.diff(np.eye(count), axis=0)
        squares: np.ndarray = apart.T @ apart
        return squares

    for column, edges in zip(codes.T, tables.thresholds, strict=True):
        count = len(edges) + 1
        parts.append(np.searchsorted(edges, column)[:, np.newaxis] == np.arange(count))
        penalties.append(BIN_SHARE * pull * np.eye(count) + FIXED["smoothness"] * steps(count))
    for pair in tables.grids:
        one, other = (np.searchsorted(t, codes[:, a]) for a, t in zip(pair.joints, pair.thresholds, strict=True))
        down, across = pair.rows.shape[:2]
        parts.append((one * across + other)[:, np.newaxis] == np.arange(down * across))
        joined = np.kron(steps(down), np.eye(across)) + np.kron(np.eye(down), steps(across))
        penalties.append(BIN_SHARE * pull * np.eye(down * across) + 0.7 * joined)
    spread = np.linalg.cholesky(np.linalg.inv(block_diag(*penalties)))
    theirs = LogisticRegression(C=1.0, fit_intercept=False, tol=1e-10, solver="newton-cg", max_iter=1000)
    theirs.fit(np.hstack(parts) @ spread, labels)
    np.testing.assert_allclose(tables.scores(switches, codes), np.hstack(parts) @ (spread @ theirs.coef_.T), atol=1e-5)


@given(SEEDS)
@settings(max_examples=8, deadline=None)
def test_neither_the_order_of_rows_nor_a_constant_joint_changes_a_bit(seed: int) -> None:
    switches, codes, labels = grasps(seed)
    order = np.random.default_rng(seed).permutation(len(labels))
    more = np.column_stack([codes, np.full(len(codes), 7, np.uint16)])
    tables = fit_pairs(switches, codes, labels, 3, **FIXED)
    again = fit_pairs(switches[order], more[order], labels[order], 3, **FIXED)
    assert not again.joint_rows[-1].any()
    thresholds, rows = again.thresholds[:-1], again.joint_rows[:-1]
    assert numbers(again.changed(thresholds=thresholds, joint_rows=rows)) == numbers(tables)


def test_joints_that_say_something_together_are_found_and_recognised() -> None:
    switches, codes, labels = grasps(3, 600)
    fresh = grasps(4, 600)
    settings = {setting.name: setting.default for setting in TRAINERS["pairs"].settings}
    del settings["max_bins"]
    tables = fit_pairs(switches, codes, labels, 3, max_bins=16, **{**settings, "pairs": 1})  # type: ignore[arg-type]
    assert [pair.joints for pair in tables.grids] == [(1, 2)]
    alone = fit_logit(np.hstack([switches, codes]), labels, 3, penalty=0.5, smoothness=2.0).score_tables(2)
    rate, without = (np.mean(each.scores(*fresh[:2]).argmax(axis=1) == fresh[2]) for each in (tables, alone))
    assert rate > 0.9 > without + 0.2


def test_pairs_share_no_joint_and_need_two_bins() -> None:
    switches, codes, labels = grasps(5, 300)
    codes = np.column_stack([codes, codes[:, 1], np.zeros_like(codes[:, 0])])
    tables = fit_pairs(switches, codes, labels, 3, **FIXED, pairs=9)
    joints = [joint for pair in tables.grids for joint in pair.joints]
    assert len(set(joints)) == len(joints) == 4
    assert 5 not in joints
    assert not fit_pairs(switches, codes[:, :1], labels, 3, **FIXED).grids


@pytest.mark.parametrize(
    "wrong", [{"penalty": 0.0}, {"smoothness": -1.0}, {"pair_smoothness": np.inf}, {"pair_bins": 17}]
)
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(TrainingError, match=r"finite|pair_bins=17 must be 2 to 16"):
        fit_pairs(*grasps(0), 3, **{**FIXED, **wrong})
