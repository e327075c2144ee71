"""Tables with fewer of their inputs, on which a frontier's times are checked."""

import numpy as np

from thenar.compiler.frontier.timing.checks import with_fewer
from thenar.runtime.tables import IntegerTables, Pair


def test_a_pair_stays_while_both_of_its_joints_do() -> None:
    steps = tuple(np.array([5], np.uint16) for _ in range(4))
    pairs = tuple(Pair(joints, (steps[0], steps[0]), np.ones((2, 2, 3), np.int16)) for joints in ((0, 3), (1, 2)))
    none = np.zeros((0, 3), np.int16)
    rows = tuple(np.zeros((2, 3), np.int16) for _ in steps)
    tables = IntegerTables(np.zeros(3, np.int16), none, steps, rows, none, np.zeros((4, 3), np.int16), 1.0, pairs=pairs)
    assert [pair.joints for pair in with_fewer(tables, 0, 4).pairs] == [(0, 3), (1, 2)]
    assert [pair.joints for pair in with_fewer(tables, 0, 3).pairs] == [(1, 2)]
    assert not with_fewer(tables, 0, 2).pairs
