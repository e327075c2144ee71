from dataclasses import replace

import numpy as np
import pytest

from thenar.compiler.frontier.streaming.streams import stream_of
from thenar.compiler.frontier.waiting import digest
from thenar.compiler.recordings.graspset import GraspSet


def test_equal_streams_are_one_and_any_difference_makes_another(grasp_set: GraspSet) -> None:
    labels = np.unique(grasp_set.labels, return_inverse=True)[1]
    stream = stream_of(grasp_set, labels, seed=1, grasps=20)
    assert digest(stream) == digest(stream_of(grasp_set, labels, seed=1, grasps=20))
    assert digest(stream) != digest(stream_of(grasp_set, labels, seed=2, grasps=20))
    for name in ("bits", "codes", "at_us", "types", "arrivals", "ends"):
        changed = getattr(stream, name).copy()
        changed.flat[-1] = not changed.flat[-1]
        assert digest(replace(stream, **{name: changed})) != digest(stream), name


@pytest.mark.parametrize("said", ["", "another sentence"])
def test_a_streams_sentence_is_no_part_of_it(grasp_set: GraspSet, said: str) -> None:
    labels = np.unique(grasp_set.labels, return_inverse=True)[1]
    stream = stream_of(grasp_set, labels, seed=1, grasps=20)
    assert digest(replace(stream, what=said)) == digest(stream)
