from collections.abc import Callable

import numpy as np
import pytest

from thenar.runtime import Build
from thenar.runtime.live.recogniser import MissingInputs, weights

MakeBuild = Callable[..., Build]


def weighted(build: Build) -> Build:
    """Switches of weight 1, 2, 3 and 4, joints of 10 together."""
    rows = np.zeros((4, 4), np.int16)
    rows[range(4), range(4)] = [1, -2, 3, 4]
    joints = (np.array([[0, 0, 0, 0], [3, -2, 0, 0]], np.int16), np.array([[0, 1, 0, 0], [0, 6, 0, 0]], np.int16))
    steps = (np.array([9], np.uint16),) * 2
    return Build(build.manifest, build.tables.changed(switch_rows=rows, thresholds=steps, joint_rows=joints))


def test_an_input_weighs_how_far_its_rows_lie_apart(make_build: MakeBuild) -> None:
    assert weights(weighted(make_build(switches=4, joints=2)).tables) == [1, 2, 3, 4, 5, 5]


@pytest.mark.parametrize(
    ("lost", "joints_lost", "expected"),
    [
        (0, 0, ((), False)),
        (0b0101, 0, (("s0", "s2"), False)),
        (0b1111, 0, (("s0", "s1", "s2", "s3"), False)),
        (0, 0b11, (("j0", "j1"), False)),
        (0b0001, 0b10, (("s0", "j1"), False)),
        (0b0001, 0b11, (("s0", "j0", "j1"), True)),
        (0b1111, 0b11, (("s0", "s1", "s2", "s3", "j0", "j1"), True)),
    ],
)
def test_more_than_half_of_the_weight_is_too_much(
    make_build: MakeBuild, lost: int, joints_lost: int, expected: tuple[tuple[str, ...], bool]
) -> None:
    inputs = MissingInputs(weighted(make_build(switches=4, joints=2)), 0.5)
    for _ in range(2):
        assert inputs.of(lost, joints_lost) == expected
        assert inputs.may_be_lost(lost, joints_lost) is not expected[1]
        assert inputs.of(0, 0) == ((), False)


def test_when_nothing_can_be_read_that_is_too_much_whatever_the_limit(make_build: MakeBuild) -> None:
    both = MissingInputs(make_build(switches=4, joints=2), 1.0)
    assert [both.of(*lost)[1] for lost in ((15, 0), (7, 3), (15, 3))] == [False, False, True]
    assert MissingInputs(make_build(switches=4, joints=0), 1.0).of(15, 0)[1]
    assert MissingInputs(make_build(switches=0, joints=2), 1.0).of(0, 3)[1]


def test_inputs_that_weigh_nothing_may_all_but_vanish(make_build: MakeBuild) -> None:
    build = make_build(switches=4, joints=0)
    idle = Build(build.manifest, build.tables.changed(switch_rows=np.zeros((4, 4), np.int16)))
    assert not MissingInputs(idle, 0.0).of(7, 0)[1]
    assert MissingInputs(idle, 0.0).of(15, 0)[1]
