from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule, run_state_machine_as_test

from thenar.runtime.errors import FrameError
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.scores import LiveScores, Scorer

MakeTables = Callable[..., IntegerTables]


def flags(mask: int, count: int) -> np.ndarray:
    return np.array([mask >> bit & 1 for bit in range(count)], bool)


class Changes(RuleBasedStateMachine):
    """Any changes, in any order, beside a frame that is added up whole."""

    tables: IntegerTables

    def __init__(self) -> None:
        super().__init__()
        self.whole, self.live = Scorer(self.tables), LiveScores(Scorer(self.tables))
        self.closed = self.lost = 0
        self.codes: list[int] | None = None

    @rule(data=st.data())
    def switches_change(self, data: st.DataObject) -> None:
        masks = st.integers(0, (1 << self.tables.n_switches) - 1)
        self.closed, self.lost = data.draw(masks), data.draw(st.just(0) | masks)
        self.live.biased_scores(self.closed, self.lost)

    @rule(data=st.data())
    def joints_change(self, data: st.DataObject) -> None:
        joints = self.tables.n_joints
        codes = st.lists(st.integers(0, 260) | st.just(65535), min_size=joints, max_size=joints)
        self.codes = data.draw(st.none() | codes)
        self.live.joints(self.codes)

    @invariant()
    def lanes_are_those_of_the_whole_frame(self) -> None:
        switches, joints = self.tables.n_switches, self.tables.n_joints
        expected = self.whole.biased_scores_without(
            flags(self.closed, switches),
            [0] * joints if self.codes is None else self.codes,
            flags(self.lost, switches),
            np.full(joints, self.codes is None),
        )
        assert self.live.biased_scores(self.closed, self.lost) == expected


@pytest.mark.parametrize(("classes", "switches", "joints"), [(5, 9, 3), (2, 0, 2), (14, 40, 16), (3, 4, 0), (4, 5, 1)])
def test_any_changes_lead_to_the_scores_of_the_whole_frame(
    make_tables: MakeTables, classes: int, switches: int, joints: int
) -> None:
    machine = type("ChangesOfThese", (Changes,), {"tables": make_tables(3, classes, switches, joints)})
    run_state_machine_as_test(machine, settings=settings(max_examples=20, stateful_step_count=20, deadline=None))


@pytest.mark.parametrize("sign", [+1, -1])
def test_changes_at_the_edge_of_int16_do_not_spill(sign: int) -> None:
    def rows(*values: int) -> np.ndarray:
        return np.array(values, np.int16).reshape(-1, 2) * np.int16(sign)

    tables = IntegerTables.of(rows(0, 7)[0], rows(32767, -32760), (), (), rows(-1, 1), rows(), 1.0)
    live, whole = LiveScores(Scorer(tables)), Scorer(tables)
    for closed, lost in [(1, 0), (0, 1), (1, 1), (0, 0), (1, 0)]:
        assert live.biased_scores(closed, lost) == whole.biased_scores_without([closed], [], [lost], [])


@pytest.mark.parametrize(("closed", "lost"), [(1 << 9, 0), (0, 1 << 9), (-1, 0), (0, -1)])
def test_a_switch_that_the_build_does_not_have_is_refused(make_tables: MakeTables, closed: int, lost: int) -> None:
    with pytest.raises(FrameError, match="beyond the 9 of the build"):
        LiveScores(Scorer(make_tables())).biased_scores(closed, lost)


@pytest.mark.parametrize("codes", [[], [1, 2], [1, 2, 3, 4]])
def test_codes_of_another_glove_are_refused(make_tables: MakeTables, codes: list[int]) -> None:
    with pytest.raises(FrameError, match="the build has 3 joints"):
        LiveScores(Scorer(make_tables())).joints(codes)
