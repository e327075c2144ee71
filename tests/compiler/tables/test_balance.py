from collections.abc import Callable

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.tables.balance import balance
from thenar.compiler.tables.collapse import ScoreTables, collapse
from thenar.compiler.tables.scales import reach

MakeStumps = Callable[..., Stumps]
MakeRows = Callable[..., tuple[np.ndarray, np.ndarray]]


@given(seed=st.integers(0, 10_000), joints=st.integers(0, 3))
def test_balancing_changes_no_score_and_never_coarsens(
    make_stumps: MakeStumps, make_rows: MakeRows, seed: int, joints: int
) -> None:
    tables = collapse(make_stumps(seed, joints=joints), 6)
    balanced = balance(tables)
    bits, codes = make_rows(seed, joints=joints)
    assert np.allclose(balanced.scores(bits, codes), tables.scores(bits, codes), rtol=0, atol=1e-11)
    assert reach(balanced, 1.0, rounded=False) <= reach(tables, 1.0, rounded=False) * (1 + 1e-12)


@given(seed=st.integers(0, 10_000))
def test_with_the_bias_gone_partial_sums_reach_no_further_than_scores(make_stumps: MakeStumps, seed: int) -> None:
    tables = collapse(make_stumps(seed, rounds=60), 6)
    balanced = balance(tables)
    gone = np.abs(balanced.bias) < 1e-12
    highest = balanced.bias + np.maximum(balanced.switch_rows, 0).sum(axis=0)
    highest += sum(rows.max(axis=0) for rows in balanced.joint_rows)
    reached = np.maximum(balanced.switch_rows, 0).sum(axis=0)
    reached += sum(np.maximum(rows.max(axis=0), 0) for rows in balanced.joint_rows)
    assert np.allclose(highest[gone], reached[gone], rtol=0, atol=1e-10)


def test_a_bias_that_the_joints_have_room_for_is_gone() -> None:
    rows = np.array([[-4.0, 1.0], [6.0, 5.0]])
    tables = ScoreTables(np.array([3.0, -2.0]), np.zeros((0, 2)), (np.array([9], np.uint16),), (rows,))
    balanced = balance(tables)
    assert balanced.bias.tolist() == [0.0, 0.0]
    assert balanced.joint_rows[0].tolist() == [[-1.0, -1.0], [9.0, 3.0]]
