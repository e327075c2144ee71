"""Subsets of switches that tell many pairs apart: found greedily, and bettered by exchanging one switch at a time."""

import numpy as np

from ..samples import Columns
from .pairs import Pairs


def filled(pairs: Pairs, columns: Columns, m: int, among: Columns | None = None) -> Columns:
    """Return `columns` and, after them, what tells most further pairs apart, one by one, until there are m.

    among  what may be taken (None: every switch that varies); it must hold enough. Ties go to the lowest number.
    """
    allowed = pairs.varying if among is None else np.array(sorted(among), dtype=np.intp)
    while len(columns) < m:
        open_ones = allowed[~np.isin(allowed, columns)]
        gains = pairs.gains(columns)[open_ones]
        columns = (*columns, int(open_ones[gains.argmax()]))
    return columns


def swapped(pairs: Pairs, columns: Columns) -> Columns:
    """Return `columns` after exchanging one for a better one, over and over, until no exchange leaves fewer alike."""
    least = pairs.alike(columns)
    place = tried = 0
    while tried < len(columns):
        other = filled(pairs, columns[:place] + columns[place + 1 :], len(columns))
        tried += 1
        if (found := pairs.alike(other)) < least:
            columns, least, tried = other, found, 0
        place = (place + 1) % len(columns)
    return columns
