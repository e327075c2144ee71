"""The first structural oddity of a table, for the error that finds no inputs or no grasp types in it."""

import numpy as np

from thenar.runtime.names import shortened

from .cells import numbers
from .errors import list_rows
from .table import Table


def first_oddity(table: Table) -> str:
    """Return the first oddity of `table` as the end of a sentence, with what to do; "" if there is none."""
    if len(table.columns) == 1:
        (name,) = table.columns
        return f"its rows have one cell each, under {shortened(repr(name))}: name the `delimiter` in a columns.toml"
    odd: list[tuple[int, str, str]] = []
    for name, column in table.columns.items():
        wrong = np.flatnonzero(numbers(column, table.decimal).wrong)
        if not wrong.size:
            continue
        row, cell = int(wrong[0]), str(column[wrong[0]]).strip()
        shown = f"{list_rows(table.rows[[row]])} has {shortened(repr(cell))} in column {shortened(repr(name))}"
        if cell[:1] in ("[", "("):
            odd.append((row, name, f"{shown}: write a list of numbers in each cell, or a column for each number"))
        elif 2 * wrong.size < len(column):
            odd.append((row, name, f"{shown}, which holds numbers elsewhere: correct the cell or delete the row"))
    return min(odd)[2] if odd else ""
