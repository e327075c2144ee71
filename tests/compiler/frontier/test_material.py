from collections.abc import Callable

import numpy as np
import pytest

from thenar.compiler.frontier.material import Cuts, Material
from thenar.compiler.frontier.points import FrontierError
from thenar.compiler.frontier.settings import Search
from thenar.compiler.placement.ports import PortCosts
from thenar.compiler.recordings.graspset import GraspSet

SEARCH = Search(methods=("id3",), rivals=(), repeats=2)


def test_nobody_left_out_is_trained_on(make_set: Callable[..., GraspSet]) -> None:
    material = Material.of(make_set(subjects=3), None)
    cuts = Cuts.of(material, SEARCH)
    assert len(cuts.subjects) == 3
    for fold in cuts.subjects:
        assert set(material.subjects[fold.train]).isdisjoint(material.subjects[fold.test])


def test_every_fold_tests_rows_that_it_does_not_train_on(make_set: Callable[..., GraspSet]) -> None:
    material = Material.of(make_set(subjects=2), None)
    cuts = Cuts.of(material, SEARCH)
    assert len(cuts.all) == 2 * SEARCH.folds + 2
    for fold in cuts.all:
        assert np.array_equal(np.sort(np.concatenate([fold.train, fold.test])), np.arange(len(material.labels)))


def test_switches_stand_in_their_order_and_joints_after_them(grasp_set: GraspSet) -> None:
    material = Material.of(grasp_set, None)
    X = material.inputs((3, 1), joints=True)
    assert np.array_equal(X[:, 0], grasp_set.switches[:, 3])
    assert np.array_equal(X[:, 2:], grasp_set.codes)
    assert material.inputs((), joints=False).shape == (len(grasp_set), 0)


def test_other_costs_of_ports_are_told_apart(grasp_set: GraspSet) -> None:
    one, two = (0,) * 13 + (1,), (0,) * 12 + (1, 1)
    several = (((0,) * 14, (1.0,)), ((0,) * 14, (2.0,)), (one, (1.0, 1.0)), (two, (1.0, 1.0)))
    costs = [None, *(PortCosts(*each) for each in several)]
    assert len({Material.of(grasp_set, each).wired for each in costs}) == len(costs)


def test_one_type_leaves_nothing_to_tell_apart(grasp_set: GraspSet) -> None:
    with pytest.raises(FrontierError, match="nothing to tell apart"):
        Material.of(grasp_set.rows(np.arange(0, 96, 4)), None)
