"""The fit is chosen inside the training rows: folds that part nothing, the rule, and what options leave open."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import log_softmax

from thenar.compiler import TRAINERS, GraspSet, Recipe, Samples, ScoreTables, Setting, Trainer
from thenar.compiler.evaluation import choosing as module
from thenar.compiler.evaluation.choosing import choose_training, inner_folds
from thenar.compiler.trainers.base import Training
from thenar.runtime.manifest import fit_name
from thenar.runtime.recipe import changed

from ..conftest import make_set


class Pointer(Trainer):
    """Believes one switch: closed is the second of two grasp types. Its tables have idle rows that are not zero."""

    name = "pointer"
    what = "one switch's opinion"
    settings = (
        Setting("switch", "Which.", int, 0),
        Setting("idle", "Rows besides.", int, 0),
        Setting("faith", "How sure it is.", float, 1.0),
    )

    def __init__(self, *tried: Mapping[str, float]) -> None:
        self.tried = tried

    def train(self, samples: Samples, settings: Mapping[str, Any], report: Any = None) -> ScoreTables:
        rows = np.zeros((samples.n_switches, 2))
        rows[settings["switch"], 1] = 2 * settings["faith"]
        if settings["idle"]:
            rows[-settings["idle"] :] += 1e-9
        return ScoreTables.of(np.array([settings["faith"], 0.0]), rows, (), ())


def _pointing(monkeypatch: pytest.MonkeyPatch, *tried: Mapping[str, float]) -> tuple[Training, ...]:
    monkeypatch.setitem(TRAINERS.__dict__, "_members", MappingProxyType({"pointer": Pointer(*tried)}))
    return Training.candidates(Recipe())


def _samples(*wrong: list[int], n: int = 60, idle: int = 20, subjects: int = 1) -> Samples:
    """Return two grasp types, and switches that tell them apart but in these rows, and others that tell nothing."""
    labels = np.arange(n) // subjects % 2
    closed = np.zeros((n, len(wrong) + idle), bool)
    for switch, rows in enumerate(wrong):
        closed[:, switch] = labels == 1
        closed[rows, switch] ^= True
    return Samples(closed, np.zeros((n, 0), np.uint16), labels, ("cup", "pen"), subjects=np.arange(n) % subjects)


@given(st.data(), st.integers(1, 7), st.integers(1, 9))
def test_inner_folds_part_no_trial_and_no_group(data: st.DataObject, n_groups: int, n_trials: int) -> None:
    """Each group has trials of its own, of some frames in any order."""
    trials = np.repeat(np.arange(n_groups * n_trials), 2)
    order = np.array(data.draw(st.permutations(range(len(trials)))))
    trials = trials[order]
    groups, labels = np.array([f"g{trial // n_trials}" for trial in trials]), trials % 3
    samples = Samples(
        np.zeros((len(trials), 1), bool), np.zeros((len(trials), 0), np.uint16), labels, tuple("abc"), trials
    )
    for named in (None, groups):
        folds = inner_folds(samples, 1, named)
        assert bool(folds) == (n_groups * n_trials > 1)
        tested = np.concatenate([fold.test for fold in folds]) if folds else np.arange(len(trials))
        assert np.array_equal(np.sort(tested), np.arange(len(trials)))
        for fold in folds:
            assert len(fold.train)
            assert not set(trials[fold.train]) & set(trials[fold.test])
            assert named is None or n_groups < 3 or not set(groups[fold.train]) & set(groups[fold.test])


@pytest.mark.parametrize("by", [None, "subject"])
def test_every_candidate_is_scored_as_if_it_were_trained_alone(by: str | None) -> None:
    """An oracle in a few lines, of trials with several frames; staged rounds are those of trainings of their own."""
    grasp_set = make_set(subjects=4, frames=3)
    samples = Samples.of(grasp_set)
    groups = grasp_set.subjects if by else None
    candidates = [Training.of(Recipe(trainer="logitboost", rounds=rounds)) for rounds in (2, 9)]
    candidates.append(Training.of(changed(Recipe(), {"trainer": "logit", "max_bins": 4})))
    folds = inner_folds(samples, 5, groups)
    factors, expected = 2.0 ** np.arange(-6, 4)[:, np.newaxis, np.newaxis], []
    for candidate in candidates:
        hits, losses = 0, np.zeros(len(factors))
        for fold in folds:
            learning, test = samples.rows(fold.train), samples.rows(fold.test)
            scores = candidate.draft(learning).scores(test.switches, test.codes)
            for trial in np.unique(test.trials):
                own = scores[test.trials == trial]
                label = test.labels[test.trials == trial][0]
                hits += np.bincount(own.argmax(axis=1)).argmax() == label
                losses -= log_softmax(factors * own, axis=2)[:, :, label].mean(axis=1)
        expected.append((hits, losses.min() / 96))
    fitting = choose_training(samples, candidates, seed=5, groups=groups, of="new subject")
    assert (fitting.of, fitting.folds, fitting.tried) == ("new subject" if by else "pooled", len(folds), 3)
    shown = {each.name: (each.correct, each.loss) for each in fitting.compared}
    scored = {fit_name(each.trainer, each.settings): right for each, right in zip(candidates, expected, strict=True)}
    for name, (correct, loss) in shown.items():
        assert correct == scored[name][0]
        assert loss == pytest.approx(scored[name][1], abs=1e-6)
    assert {each.trainer for each in fitting.compared} == {"logitboost", "logit"}
    assert max(each.correct for each in fitting.compared) == max(hits for hits, _ in expected)


@pytest.mark.parametrize("jobs", [1, 2])
def test_any_number_of_workers_chooses_the_same(grasp_set: GraspSet, jobs: int) -> None:
    candidates = Training.candidates(Recipe(trainer="logitboost")) + Training.candidates(
        changed(Recipe(), {"trainer": "logit", "max_bins": 4, "penalty": 1.0})
    )
    seen: list[tuple[int, int]] = []
    fitting = choose_training(Samples.of(grasp_set), candidates, jobs=jobs, report=lambda *done: seen.append(done))
    assert fitting == choose_training(Samples.of(grasp_set), candidates)
    total = len(candidates) * len(inner_folds(Samples.of(grasp_set), 1)) + 1
    assert seen == sorted(set(seen))
    assert {several for _, several in seen} == {total}
    assert seen[-1][0] == total - 1


def test_after_the_first_fold_the_surest_three_go_on_and_the_most_accurate(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first is right everywhere but sure of nothing; the last but one would win in the folds after the first."""
    samples = _samples([], [*range(9)], [0, 1, 2], [0, 1, 2], [0, 1, 2, 3])
    wanted: list[Mapping[str, float]] = [
        {"switch": 0, "faith": 1e-3},
        *({"switch": switch} for switch in (2, 3, 4)),
        {"switch": 1},
    ]
    candidates = _pointing(monkeypatch, *wanted)
    fitted: list[int] = []
    draft = Training.draft

    def counted(self: Training, learnt: Samples) -> Any:
        fitted.append(int(self.settings["switch"] or 0))
        return draft(self, learnt)

    monkeypatch.setattr(Training, "draft", counted)
    fitting = choose_training(samples, candidates)
    assert {switch: fitted.count(switch) for switch in range(5)} == {0: 4, 1: 1, 2: 4, 3: 4, 4: 4}
    assert fitting.tried == 5


def test_the_best_is_chosen_where_others_are_clearly_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nine misses, two, and two others besides: the third is surer, but behind by more than a standard error."""
    candidates = _pointing(monkeypatch, {"switch": 0}, {"switch": 1, "faith": 0.1}, {"switch": 2, "faith": 3.0})
    samples = _samples([*range(9)], [0, 1], [0, 1, 2, 3, 4, 5])
    fitting = choose_training(samples, candidates)
    assert fitting.settings["switch"] == 1
    assert fitting.why == "it has the highest accuracy, 96.7 % of 60 trials in inner folds"
    (shown,) = fitting.compared
    assert (shown.correct, shown.total, shown.behind, shown.rows) == (58, 60, 0.0, 1.0)


def test_within_one_standard_error_small_tables_then_low_loss_win(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One trial of difference is one standard error of it, or a little less."""
    best = {"switch": 0, "idle": 5000}
    candidates = _pointing(monkeypatch, best, {"switch": 1, "faith": 0.1}, {"switch": 1, "faith": 1.0})
    samples = _samples([0], [0, 1], idle=6000)
    fitting = choose_training(samples, candidates)
    assert fitting.settings == {"switch": 1.0, "idle": 0.0, "faith": 1.0}
    assert fitting.why.startswith(
        "its accuracy is 96.7 % of 60 trials in inner folds, within one standard error of the best, "
    )
    first, chosen = fitting.compared
    assert (first.correct, first.behind, first.behind_error) == (59, 0.0, 0.0)
    assert (first.rows, chosen.rows) == (5001.0, 1.0)
    assert chosen.behind == pytest.approx(1 / 60, abs=1e-6)
    assert chosen.behind_error >= chosen.behind
    # Eight kilobytes are small enough; equal in all, the first is taken.
    candidates = _pointing(monkeypatch, {"switch": 0, "idle": 20}, {"switch": 1}, {"switch": 2})
    assert choose_training(_samples([0], [0, 1], [0, 1]), candidates).settings["switch"] == 0
    candidates = _pointing(monkeypatch, {"switch": 2}, {"switch": 1})
    assert choose_training(_samples([0], [0, 1], [0, 1]), candidates).settings["switch"] == 2


def test_leads_within_one_subject_are_not_chosen_for_new_subjects(monkeypatch: pytest.MonkeyPatch) -> None:
    """The misses of one switch are all of one subject: over people that is no clear lead, over trials it is."""
    n, subjects = 60, 5
    of_one = [row for row in range(n) if row % subjects == 0][:6]
    samples = _samples([], of_one, subjects=subjects, idle=6000)
    candidates = _pointing(monkeypatch, {"switch": 0, "idle": 5000}, {"switch": 1})
    assert choose_training(samples, candidates).settings["switch"] == 0
    fitting = choose_training(samples, candidates, groups=samples.subjects, of="new subject")
    assert fitting.settings["switch"] == 1
    assert fitting.compared[-1].behind_error == pytest.approx(fitting.compared[-1].behind, abs=1e-6)


@pytest.mark.parametrize(
    ("changes", "trainers"),
    [
        ({}, set(TRAINERS) - {"logitboost", "logit"}),
        ({"max_bins": 8}, set(TRAINERS) - {"logitboost", "logit"}),
        ({"rounds": 3}, {"logitboost"}),
        ({"shrinkage": 0.5}, {"logitboost"}),
        ({"penalty": 2.0}, {"linear"}),
        ({"trainer": "logit"}, {"logit"}),
        ({"trainer": "logitboost"}, {"logitboost"}),
    ],
)
def test_given_settings_are_fixed_and_select_their_trainer(changes: dict[str, Any], trainers: set[str]) -> None:
    candidates = Training.candidates(changed(Recipe(), changes))
    assert {each.trainer for each in candidates} == trainers
    assert len({repr(each) for each in candidates}) == len(candidates)
    for each in candidates:
        assert set(each.settings) == {setting.name for setting in TRAINERS[each.trainer].settings}
        assert all(each.settings.get(name, value) == value for name, value in changes.items() if name != "trainer")


@pytest.mark.parametrize(
    "changes", [{"rounds": 3}, {"trainer": "logit", "penalty": 1.0, "smoothness": 2.0, "max_bins": 8}]
)
def test_where_all_that_is_compared_is_given_one_candidate_is_left(changes: dict[str, Any]) -> None:
    assert len(Training.candidates(changed(Recipe(), changes))) == 1


@pytest.mark.parametrize(("frames", "compared"), [(1, 240), (7, 238), (24, 80)])
def test_long_trials_are_sampled_and_none_is_left_out(
    monkeypatch: pytest.MonkeyPatch, frames: int, compared: int
) -> None:
    seen, train = list[int](), Pointer.train

    def counting(self: Pointer, samples: Samples, settings: Mapping[str, Any], report: Any = None) -> ScoreTables:
        seen.append(len(samples.labels))
        return train(self, samples, settings)

    monkeypatch.setattr(module, "_COMPARED", 100)
    monkeypatch.setattr(Pointer, "train", counting)
    whole = _samples([], [0], n=240 // frames, idle=0)
    samples = replace(whole.rows(np.repeat(np.arange(240 // frames), frames)), movements=np.empty(0, np.intp))
    fitting = choose_training(samples, _pointing(monkeypatch, {"switch": 0}, {"switch": 1}))
    assert {found.total for found in fitting.compared} == {240 // frames}
    # Both ways, in folds whose training rows make up the set but for one.
    assert sum(seen) == 2 * (fitting.folds - 1) * compared
