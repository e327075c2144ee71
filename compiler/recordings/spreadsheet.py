"""Texts as cells of a CSV that spreadsheets open: none is a formula."""

import re
from collections.abc import Iterable

# What a spreadsheet computes, behind whatever apostrophes are there: so each text has one cell, and each cell one text.
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


def cell(text: str) -> str:
    """Return `text` with an apostrophe before it where a spreadsheet would take it for a formula."""
    return f"'{text}" if _FORMULA.match(text) else text


def cells(row: Iterable[object]) -> list[object]:
    """Return `row` with each text as a cell; numbers stay as they are."""
    return [cell(value) if isinstance(value, str) else value for value in row]


def text_of(cell: str) -> str:
    """Return the text whose `cell` it is."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell
