"""Straight-line code for an AVR: for which tables it is written, and what entries cost. Its scores: test_core.py."""

import numpy as np

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.straight import Straight, straight
from thenar.compiler.firmware.words import numbered
from thenar.runtime.model.integers import IntegerTables

from .conftest import make_tables


def of_switch(row: list[int]) -> Straight:
    """Return the code of one switch with a row."""
    rows, none = np.array([row], np.int16), np.empty((0, len(row)), np.int16)
    tables = IntegerTables.of(np.ones(len(row), np.int16), rows, (), (), 0 * rows, none, 1.0)
    function = straight(Layout(tables))
    assert function is not None
    return function


def test_it_is_for_tables_without_bins_and_grids() -> None:
    assert straight(Layout(make_tables(joints=1))) is None
    assert straight(Layout(make_tables(joints=0))) is not None
    for joints, there in ((0, True), (1, False)):
        tables = make_tables(joints=joints)
        text = Library("hand", numbered(tables), Layout(tables)).files["thenar_hand.c"]
        assert (".sum = straight," in text, ".sum = thenar_sum," in text) == (there, True)


def test_an_entry_of_0_costs_nothing_and_a_multiple_of_256_one_instruction() -> None:
    none, one, two, fine = (of_switch(row) for row in ([0, 0], [256, 0], [256, -512], [256, 1]))
    assert len(one.instructions) - len(none.instructions) == 2  # with the skip
    assert len(two.instructions) - len(none.instructions) == 4  # with the branch
    assert len(fine.instructions) - len(two.instructions) == 3
    assert [function.cycles - none.cycles for function in (one, two, fine)] == [2, 4, 7]


def test_more_than_13_types_take_another_pass() -> None:
    few, many = of_switch([256] * 13), of_switch([256] * 14)
    assert [what for what, _ in few.steps].count("the scores") == 1
    assert [what for what, _ in many.steps].count("the scores") == 2
    assert all(len(line) <= 120 for _, lines in many.statements for line in lines)
