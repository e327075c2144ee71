"""One nested evaluation, done once more with scikit-learn's own splitting, pipelines and predictions."""

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sklearn.base import BaseEstimator
from sklearn.feature_selection import SelectorMixin
from sklearn.model_selection import GroupKFold, LeaveOneGroupOut, cross_val_predict
from sklearn.pipeline import make_pipeline

from thenar.compiler import GraspSet, LogitBoostClassifier, evaluate, grow_id3
from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.text import INDEPENDENT

from .conftest import make_grasps

NESTED: dict[str, Any] = {"protocols": ("nested",), "tables": ("compositions",), "rounds": 10, "jobs": 1}


class PapersSwitches(SelectorMixin, BaseEstimator):  # type: ignore[misc]
    """The paper's placement, as scikit-learn's feature selection."""

    def fit(self, X: np.ndarray, y: np.ndarray) -> "PapersSwitches":
        self.kept = np.isin(np.arange(X.shape[1]), grow_id3(X, y).inputs)
        return self

    def _get_support_mask(self) -> np.ndarray:
        return self.kept


def framed(frames: int = 3) -> GraspSet:
    """Return three people's trials of several frames, each frame with a flipped switch or two of its own."""
    one = make_grasps(subjects="ABC", per_type=6, noise=0.2)
    rows = one.rows(np.repeat(np.arange(len(one)), frames))
    flips = np.random.default_rng(3).random(rows.switches.shape) < 0.08
    return replace(rows, switches=rows.switches ^ flips, sessions=np.where(rows.trials < 3, "1", "2"))


def majorities(predicted: list[str], grasp_set: GraspSet) -> int:
    """Return how many trials are recognised by most of their frames, the first type by name of several."""
    columns = (grasp_set.subjects, grasp_set.grasps, grasp_set.objects, grasp_set.trials)
    votes: dict[tuple[str, str, str, int], Counter[str]] = {}
    for found, *trial in zip(predicted, *(column.tolist() for column in columns), strict=True):
        votes.setdefault(tuple(trial), Counter())[found] += 1
    return sum(min(vote, key=lambda grasp: (-vote[grasp], grasp)) == trial[1] for trial, vote in votes.items())


def test_leaving_subjects_out_matches_a_scikit_learn_pipeline() -> None:
    grasp_set = framed()
    study = evaluate(grasp_set, scheme="subject", **NESTED)
    selected = make_pipeline(PapersSwitches(), LogitBoostClassifier(rounds=10))
    predicted = cross_val_predict(
        selected, grasp_set.switches, grasp_set.grasps, groups=grasp_set.subjects, cv=LeaveOneGroupOut()
    )
    (row,) = (row for row in study.tables[0].rows if row.name == "VI")
    assert row.frames is not None
    assert row.frames.correct == (int((predicted == grasp_set.grasps).sum()),)
    assert row.rate.correct == (majorities(predicted.tolist(), grasp_set),)
    assert (row.rate.total, row.frames.total, row.rate.over) == (72, 216, 3)
    assert (row.rate.what, row.frames.what) == ("new subject, trials", "new subject, frames")
    for name, cell in zip("ABC", row.cells, strict=True):
        mine = grasp_set.subjects == name
        assert cell.rate.correct == (majorities(predicted[mine].tolist(), grasp_set.rows(mine)),)


def test_sessions_left_out_are_those_of_scikit_learn_too() -> None:
    grasp_set = framed()
    study = evaluate(grasp_set, scheme="session", **NESTED)
    (row,) = (row for row in study.tables[0].rows if row.name == "V")
    for name, cell in zip("ABC", row.cells, strict=True):
        mine = grasp_set.rows(grasp_set.subjects == name)
        predicted = cross_val_predict(
            LogitBoostClassifier(rounds=10), mine.switches, mine.grasps, groups=mine.sessions, cv=GroupKFold(2)
        )
        assert cell.frames is not None
        assert cell.frames.correct == (int((predicted == mine.grasps).sum()),)
        assert (cell.rate.what, cell.rate.over) == ("new session, trials", 2)
    assert row.rate.over == 6


def test_frames_that_count_as_trials_are_refused() -> None:
    one = make_grasps(per_type=4, noise=0.3)
    frames = one.rows(np.repeat(np.arange(len(one)), 5))
    wrong = replace(frames, trials=np.arange(len(frames)))
    with pytest.raises(EvaluationError, match="of fewer trials"):
        evaluate(wrong, **NESTED)
    claimed = evaluate(replace(wrong, independent=True), folds=2, **NESTED)
    assert claimed.warnings[0] == INDEPENDENT
