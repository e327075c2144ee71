import numpy as np
import pytest

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.cells import Column
from thenar.compiler.recordings.columns import ColumnRoles, JointColumns, select
from thenar.compiler.recordings.readings import read_cells
from thenar.compiler.recordings.table import Table

GOOD = {
    "g": ["a", "b", "c"],
    "who": ["x", "y", "y"],
    "n": ["1", "2", "3"],
    "s": ["0", "1", "true"],
    "j": ["1.5", "2", "3"],
}


def read(columns: ColumnRoles, **cells: Column) -> None:
    table = Table("t.csv", GOOD | cells, np.array([2, 3, 5]))
    read_cells(table, columns, select(columns, list(table.columns)))


ALL = ColumnRoles("g", subject="who", trial="n", switches=("s",), joints=(JointColumns(("j",)),))
DROP = ColumnRoles("g", subject="who", trial="n", switches=("s",), joints=(JointColumns(("j",)),), missing="drop")


def test_wrong_cells_are_counted_and_named_by_the_users_rows() -> None:
    with pytest.raises(TableError) as refused:
        read(ALL, s=["0", "2", "no"], j=["x", "1", "inf"], n=["1", "1.5", "2"], g=["a", "b\x07", "c"])
    assert str(refused.value) == (
        "t.csv: not names that can be printed: 1 cell, row 3 'g' ('b\\x07'); "
        "not 0 or 1: 2 cells, row 3 's' ('2'), row 5 's' ('no'); "
        "not finite numbers: 2 cells, row 2 'j' ('x'), row 5 'j' ('inf')"
    )


def test_missing_cells_are_an_error_unless_their_rows_may_be_dropped() -> None:
    with pytest.raises(TableError, match=r"missing .*: 2 cells, row 2 'j' \(''\), row 5 'who' \('\?'\)"):
        read(ALL, j=["", "2", "3"], who=["x", "y", "?"])


def test_a_wrong_cell_is_an_error_even_in_dropped_rows() -> None:
    with pytest.raises(TableError, match="not 0 or 1"):
        read(DROP, s=["2", "1", "1"], j=["", "2", "3"])


def test_a_table_of_which_nothing_is_left_is_refused() -> None:
    with pytest.raises(TableError, match=r"t\.csv: every row misses a value: 3 cells"):
        read(DROP, g=["", "?", " "])


def test_the_first_wrong_cells_are_named_and_the_rest_counted() -> None:
    columns = [f"s{number}" for number in range(10)]
    table = Table("t.csv", {"g": ["a"] * 9} | {name: ["7"] * 9 for name in columns}, np.arange(1, 10))
    wanted = ColumnRoles("g", switches=("s*",))
    with pytest.raises(TableError) as refused:
        read_cells(table, wanted, select(wanted, list(table.columns)))
    shown = ", ".join(f"row 1 's{number}' ('7')" for number in range(5))
    assert str(refused.value) == f"t.csv: not 0 or 1: 90 cells, {shown} and 85 more"
