"""Score tables that say the same with smaller partial sums, so that integers can be finer."""

import numpy as np

from .collapse import ScoreTables


def balance(tables: ScoreTables) -> ScoreTables:
    """Return tables of equal scores whose bias is spread over the joints' rows, as far as their ranges take it.

    What moves from the bias into all rows of a joint changes no score. A partial sum can reach |bias| plus the range of
    every input; with the bias gone it reaches no further than complete scores do, and there is nothing better.
    """
    if not tables.joint_rows:
        return tables
    lowest = np.stack([rows.min(axis=0) for rows in tables.joint_rows])
    spans = np.stack([rows.max(axis=0) for rows in tables.joint_rows]) - lowest
    # Each joint gives up its lowest row and the same share of its span; the share is such that the bias becomes zero.
    wanted, room = -tables.bias - lowest.sum(axis=0), spans.sum(axis=0)
    share = np.divide(wanted, room, out=np.zeros_like(room), where=room > 0).clip(0, 1)
    moved = lowest + share * spans
    rows = tuple(rows - shift for rows, shift in zip(tables.joint_rows, moved, strict=True))
    return ScoreTables(tables.bias + moved.sum(axis=0), tables.switch_rows, tables.thresholds, rows)
