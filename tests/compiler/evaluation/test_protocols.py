from collections.abc import Callable

import numpy as np

from thenar.compiler.evaluation.populations import populations
from thenar.compiler.evaluation.protocols import HONEST, PAPER
from thenar.compiler.recordings.graspset import GraspSet

Make = Callable[..., GraspSet]


def test_the_paper_lets_test_rows_choose_and_honesty_does_not(make_grasps: Make) -> None:
    grasps = make_grasps()
    everyone = np.arange(len(grasps))
    for scheme in ("stratified", "object", "block"):
        for part in populations(grasps, scheme, 4, 2, 1):
            for fold in part.folds:
                assert set(PAPER.may_choose(part, fold)) == set(part.rows)
                assert set(HONEST.may_choose(part, fold)) == set(part.rows) - set(fold.test)
                assert set(PAPER.may_choose_pooled(everyone, fold)) == set(everyone)
                assert set(HONEST.may_choose_pooled(everyone, fold)) == set(everyone) - set(fold.test)


def test_a_left_out_subject_has_no_say_in_an_honest_placement(make_grasps: Make) -> None:
    grasps = make_grasps()
    for part in populations(grasps, "subject", 4, 1, 1):
        (fold,) = part.folds
        assert part.name not in grasps.subjects[HONEST.may_choose(part, fold)]
        assert part.name in grasps.subjects[PAPER.may_choose(part, fold)]
