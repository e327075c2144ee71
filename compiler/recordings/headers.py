"""Where a table begins: rows before its header, and whether its first row names the columns."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence

NUMBER = re.compile(r"[+-]?(?:\d++(?:[.,]\d*+)?|[.,]\d++)(?:[eE][+-]?\d++)?")
# Cells in place of numbers, without regard to case.
MISSING_NUMBERS = frozenset({"", "?", "na", "n/a", "#n/a", "nan", "null", "none"})

_Rows = Sequence[Sequence[str]]


def skipped(rows: int) -> str:
    """Return the sentence on `rows` that precede the table."""
    return f"rows left out at the top: {rows} (skip = {rows}), which have other cells than the table below"


def preface(rows: _Rows) -> int:
    """Return how many of the first `rows` precede the table, whose header or first row comes next.

    A row of the table is as wide as most rows of the second half, and has more than half as many filled cells.
    """
    body = rows[len(rows) // 2 :]
    if not body:
        return 0
    filled = [sum(map(bool, row)) for row in rows]
    typical = sorted(filled[len(rows) // 2 :])[len(body) // 2]
    wide, wide_filled = (Counter(map(width, body)).most_common(1)[0][0] for width in (len, _filled_width))
    for number, row in enumerate(rows[: len(rows) - len(body) + 1]):
        if (len(row) == wide or _filled_width(row) == wide_filled) and 2 * filled[number] > typical:
            # A row of names that is too short or too long is a fault of the table, not a note on it.
            named = number == 0 or 2 * filled[number - 1] <= typical or has_names(rows[number:])[0]
            return number if named else 0
    return 0


def _filled_width(row: Sequence[str]) -> int:
    return max((place for place, cell in enumerate(row, start=1) if cell), default=0)


def has_names(rows: _Rows) -> tuple[bool, str]:
    """Return whether the first of `rows` names the columns, and why."""
    first, body = rows[0] if rows else [], rows[1:]
    if not body:
        return True, "the only row"
    numeric = [place for place in range(len(first)) if _is_numeric(row[place] for row in body if place < len(row))]
    if numeric:
        words = [first[place] for place in numeric if not NUMBER.fullmatch(first[place])]
        named = [word for word in words if word.casefold() not in MISSING_NUMBERS]
        if named:
            return True, f"the first row has {named[0][:40]!r} over numbers"
        return False, "none: the first row has numbers where the others have them; columns are called column 1, ..."
    repeated = {cell for row in body for cell in row}
    if repeated.isdisjoint(first):
        return True, "what the first row says occurs in no other"
    return False, "none: what the first row says occurs in others, too; columns are called column 1, ..."


def _is_numeric(cells: Iterator[str]) -> bool:
    """Return whether most of `cells` are numbers, of those that are not missing."""
    there = [bool(NUMBER.fullmatch(cell)) for cell in cells if cell.casefold() not in MISSING_NUMBERS]
    return sum(there) > 0.8 * len(there)
