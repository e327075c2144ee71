from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.runtime.errors import FrameError
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.scores import LANE_OFFSET, Scorer

from .test_scorer import summed

MakeTables = Callable[..., IntegerTables]


def flags(mask: int, count: int) -> np.ndarray:
    return np.array([mask >> bit & 1 for bit in range(count)], bool)


@pytest.mark.parametrize(("classes", "switches", "joints"), [(5, 9, 3), (2, 0, 2), (14, 40, 16), (3, 4, 0), (4, 5, 1)])
@settings(deadline=None)
@given(data=st.data())
def test_any_state_has_the_scores_of_the_whole_frame(
    make_tables: MakeTables, data: st.DataObject, classes: int, switches: int, joints: int
) -> None:
    tables, masks = make_tables(3, classes, switches, joints), st.integers(0, (1 << switches) - 1)
    scorer = Scorer(tables)
    closed, lost = data.draw(masks), data.draw(st.just(0) | masks)
    several = st.lists(st.integers(0, 260) | st.just(65535), min_size=joints, max_size=joints)
    codes, lost_joints = data.draw(st.none() | several), data.draw(st.just(0) | st.integers(0, (1 << joints) - 1))
    absent = np.full(joints, True) if codes is None else flags(lost_joints, joints)
    measured = np.array([0] * joints if codes is None else codes, np.uint16)
    expected = summed(tables, flags(closed, switches), measured, flags(lost, switches), absent)
    found = np.array(scorer.state_scores(closed, lost, codes, lost_joints)) - LANE_OFFSET
    assert found.tolist() == expected.tolist()


@pytest.mark.parametrize("sign", [+1, -1])
def test_changes_at_the_edge_of_int16_do_not_spill(sign: int) -> None:
    def rows(*values: int) -> np.ndarray:
        return np.array(values, np.int16).reshape(-1, 2) * np.int16(sign)

    tables = IntegerTables.of(rows(0, 7)[0], rows(32767, -32760), (), (), rows(-1, 1), rows(), 1.0)
    scorer = Scorer(tables)
    for closed, lost in [(1, 0), (0, 1), (1, 1), (0, 0), (1, 0)]:
        row = tables.switch_means[0] if lost else closed * tables.switch_rows[0]
        assert scorer.state_scores(closed, lost, []) == tuple((tables.bias.astype(int) + row + LANE_OFFSET).tolist())


@pytest.mark.parametrize(("closed", "lost"), [(1 << 9, 0), (0, 1 << 9), (-1, 0), (0, -1)])
def test_a_switch_that_the_build_does_not_have_is_refused(make_tables: MakeTables, closed: int, lost: int) -> None:
    with pytest.raises(FrameError, match="beyond the 9 of the build"):
        Scorer(make_tables()).state_scores(closed, lost, None)


@pytest.mark.parametrize("codes", [[], [1, 2], [1, 2, 3, 4]])
def test_codes_of_another_glove_are_refused(make_tables: MakeTables, codes: list[int]) -> None:
    with pytest.raises(FrameError, match="the build has 3 joints"):
        Scorer(make_tables()).state_scores(0, 0, codes)
