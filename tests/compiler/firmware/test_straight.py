"""Straight-line code for an AVR: for which tables it is written, and what entries cost. Its scores: test_core.py."""

import numpy as np

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.straight import Straight, straight
from thenar.compiler.firmware.words import numbered
from thenar.runtime.model.integers import IntegerTables

from .conftest import make_tables
from .test_core import made

# Instructions that change their first register.
CHANGING = {"ldi", "ldd", "mov", "movw", "clr", "add", "adc", "sub", "sbc", "subi", "sbci", "lsl", "lsr", "ror"}


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


def test_the_registers_of_a_caller_are_restored() -> None:
    """By avr-gcc's convention a function may change r0, r18 to r27, r30 and r31; r1 is 0 again at its end."""
    free = {"r0", *(f"r{number}" for number in (*range(18, 28), 30, 31))}
    for types in (2, 9, 14, 30):
        function = straight(Layout(made(classes=types, switches=9, joints=3, lines=3, constant=(0,))))
        assert function is not None
        lines = [line for _, code in function.steps for line in code if not line.endswith(":")]
        pushed = [line.split()[1] for line in lines if line.startswith("push")]
        assert [line.split()[1] for line in lines if line.startswith("pop")] == pushed[::-1]
        changed = {line.replace(",", " ").split()[1] for line in lines if line.split()[0] in CHANGING}
        changed |= {"r31"} if any(line.startswith("movw r30") for line in lines) else set()
        assert changed <= free | {"r1"} | set(pushed)
        at_r1 = [line for line in lines if line.startswith("mul ") or line.replace(",", " ").split()[1:2] == ["r1"]]
        assert at_r1[-1] == "clr r1"


def test_more_than_13_types_take_another_pass() -> None:
    few, many = of_switch([256] * 13), of_switch([256] * 14)
    assert [what for what, _ in few.steps].count("the scores") == 1
    assert [what for what, _ in many.steps].count("the scores") == 2
    assert all(len(line) <= 120 for _, lines in many.statements for line in lines)
