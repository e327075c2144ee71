from collections.abc import Callable

import numpy as np

from thenar.compiler import grow_id3
from thenar.compiler.evaluation.placements import Placements
from thenar.compiler.placement.rivals import forward_cmim, random_placement, top_mutual_information
from thenar.compiler.recordings.graspset import GraspSet

Make = Callable[..., GraspSet]
ROWS = np.arange(5, 40)


def test_every_method_sees_exactly_the_rows_given(make_grasps: Make) -> None:
    grasps = make_grasps()
    placements = Placements(grasps.switches, grasps.labels)
    X, y = grasps.switches[ROWS], grasps.labels[ROWS]
    assert placements.id3(ROWS, 4) == tuple(grow_id3(X, y, min_samples=4).inputs)
    assert placements.cmim(ROWS, 3) == tuple(forward_cmim(X, y, 3))
    assert placements.top(ROWS, 3) == tuple(top_mutual_information(X, y, 3))
    assert placements.random(3, seed=9) == tuple(random_placement(grasps.switches.shape[1], 3, 9))


def test_answers_are_kept_apart_by_method_rows_and_size(make_grasps: Make) -> None:
    grasps = make_grasps(noise=0.3)
    used, fresh = (Placements(grasps.switches, grasps.labels) for _ in range(2))
    used.id3(ROWS, 0)
    used.cmim(ROWS, 2)
    assert used.id3(ROWS, 20) == fresh.id3(ROWS, 20) != used.id3(ROWS, 0)
    assert used.id3(ROWS[:20], 0) == fresh.id3(ROWS[:20], 0)
    assert len(used.top(ROWS, 2)) == 2
    assert used.cmim(ROWS, 3) == fresh.cmim(ROWS, 3)


def test_the_order_of_rows_does_not_matter(make_grasps: Make) -> None:
    grasps = make_grasps()
    assert Placements(grasps.switches, grasps.labels).id3(ROWS, 0) == Placements(grasps.switches, grasps.labels).id3(
        ROWS[::-1], 0
    )


def test_a_set_without_switches_has_an_empty_placement(make_grasps: Make) -> None:
    grasps = make_grasps(n_switches=0)
    assert Placements(grasps.switches, grasps.labels).id3(ROWS, 0) == ()
