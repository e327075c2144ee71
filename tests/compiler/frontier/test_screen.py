from dataclasses import replace

import numpy as np
import pytest

from thenar.compiler.frontier.find import find_frontier
from thenar.compiler.frontier.marks import choices_to_mark
from thenar.compiler.frontier.points import FrontierError, PlacementChoice
from thenar.compiler.frontier.price import PricedTables, Tabled, Wired
from thenar.compiler.frontier.search import (
    Candidate,
    Search,
    Shape,
    curve_placements,
    tried_placements,
)
from thenar.compiler.frontier.timing.classify_times import Classified
from thenar.compiler.frontier.timing.scan_times import ScanTimes
from thenar.compiler.recordings.graspset import GraspSet

QUICK = Classified(40.0, "model", 900, 30)


def priced(*scans_us: float, classified: Classified | None = QUICK) -> PricedTables:
    wired = tuple(Wired("mcp23017", 400_000, ScanTimes(us, 1, 1, "wire")) for us in scans_us)
    return PricedTables(Tabled(12, Shape(16)), b"", classified, wired, 0.1)


def test_a_choice_is_as_fast_as_its_fastest_wiring() -> None:
    assert priced(900.0, 300.0).fastest_us(0) == 340.0
    assert priced(900.0, 300.0).fastest_us(1800.0) == 1840.0
    assert priced().fastest_us(1800.0) == 1840.0


def test_what_fits_no_flash_has_no_time() -> None:
    assert priced(900.0, classified=None).fastest_us(0) is None


def test_elimination_is_tried_at_every_size_up_to_all_switches() -> None:
    assert [choice.parameter for choice in tried_placements("elimination", 9)] == [1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 9.0]
    assert [choice.parameter for choice in tried_placements("elimination", 8)] == [1.0, 2.0, 3.0, 4.0, 6.0, 8.0]
    assert [choice.parameter for choice in tried_placements("elimination", 1)] == [1.0]
    assert max(choice.parameter for choice in curve_placements("rfe", 20)) == 16.0


def test_the_papers_placements_are_marked_with_all_inputs_that_there_are() -> None:
    assert Candidate(PlacementChoice("id3", 62.0), "both") in choices_to_mark(14, 3)
    assert Candidate(PlacementChoice("id3", 62.0), "switches") in choices_to_mark(14, 0)
    assert choices_to_mark(14, 0)[Candidate(PlacementChoice("elimination", 14.0), "switches")] == "all of 14"
    assert choices_to_mark(14, 3)[Candidate(PlacementChoice("elimination", 14.0), "both")] == "all of 14, joints"
    assert choices_to_mark(0, 3) == {}


def test_one_type_leaves_nothing_to_tell_apart(grasp_set: GraspSet) -> None:
    with pytest.raises(FrontierError, match="nothing to distinguish"):
        find_frontier(grasp_set.rows(np.arange(0, 96, 4)))


def test_frames_that_are_numbered_as_trials_are_refused(grasp_set: GraspSet) -> None:
    rows = grasp_set.rows(np.repeat(np.arange(96), 10))
    leaking = replace(rows, trials=np.arange(960), objects=np.repeat(np.arange(96) // 24, 10).astype(str))
    with pytest.raises(FrontierError, match="the rows that count as trials"):
        find_frontier(leaking)


def test_a_search_for_nothing_is_refused() -> None:
    with pytest.raises(FrontierError, match="at least"):
        Search(methods=())
