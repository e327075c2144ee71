"""Which joints are kept: those that tell something, in the end the one that tells most; the same on every machine."""

from dataclasses import replace

import numpy as np
import pytest

from thenar.compiler.evaluation.folds import trial_folds
from thenar.compiler.placement.methods.elimination import joint_order
from thenar.compiler.placement.placement import kept_joints, place
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import Training

from ..conftest import make_set, with_none


def hand(rows: int = 240, told: int = 3) -> Samples:
    """Return samples of a switch that tells four types into two pairs, and of twelve joints: `told` of them tell within
    a pair what the switch does not, the first best; 3 says what the switch says; 4 never moves; the others are noise.
    """
    random = np.random.default_rng(7)
    labels = np.arange(rows) % 4
    codes = random.integers(40, 200, (rows, 12))
    for joint in range(told):
        codes[:, joint] = 90 + 40 * (labels & 1) + random.normal(0, 25 + 5 * joint, rows)
    codes[:, 3] = 60 + 80 * (labels >> 1)
    codes[:, 4] = 77
    return Samples((labels > 1)[:, np.newaxis], codes.astype(np.uint16), labels, tuple("abcd"))


def test_what_tells_most_beside_the_switches_goes_last() -> None:
    samples = hand()
    order = joint_order(samples)
    assert set(order) == set(range(12)) - {4}
    assert order[0] == 0
    assert set(order[:3]) == {0, 1, 2}
    assert joint_order(samples.keeping(()))[:2] in ((0, 3), (3, 0))
    assert order == joint_order(hand())


def test_the_requested_number_of_joints_or_all_are_kept() -> None:
    samples = hand()
    assert kept_joints(samples, None) == kept_joints(samples, 12) == tuple(range(12))
    assert kept_joints(samples, 2) == tuple(sorted(joint_order(samples)[:2]))
    assert len(kept_joints(samples, 11)) == 11
    assert kept_joints(samples.with_joints(()), 3) == kept_joints(samples.with_joints((4,)), None)[:0] == ()


@pytest.mark.parametrize("most", [2, 4])
def test_a_few_recognise_as_well_as_all(most: int) -> None:
    samples, training = hand(), Training("logitboost", {"rounds": 30})

    def rate(most: int | None) -> float:
        hits = []
        for fold in trial_folds(samples.labels, samples.trials, 3, 1):
            learnt, test = samples.rows(fold.train), samples.rows(fold.test)
            joints = kept_joints(learnt, most)
            learnt, test = learnt.with_joints(joints), test.with_joints(joints)
            model = training.train(learnt)
            hits += (model.scores(test.switches, test.codes).argmax(axis=1) == test.labels).tolist()
        return float(np.mean(hits))

    assert rate(most) >= rate(None) - 0.01


def test_rows_in_which_nothing_is_held_place_no_switch() -> None:
    grasps = make_set(subjects=8, types=2)
    more = with_none(grasps)
    found, other = place(grasps, prune=4, keep_joints=1), place(more, prune=4, keep_joints=1)
    assert other.fingerprint == more.fingerprint()
    assert replace(other, fingerprint=found.fingerprint) == found
