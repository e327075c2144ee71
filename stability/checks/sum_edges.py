"""Tables whose sums reach +-32767 exactly, and those that could reach one more."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from thenar.compiler.tables.furthest import furthest
from thenar.runtime.errors import BuildError
from thenar.runtime.scores import LANE_OFFSET, Scorer
from thenar.runtime.tables import LIMIT, MAX_CLASSES, IntegerTables, tables_from_bytes, tables_to_bytes

from ..finding import Finding, Worst

# What can add the last step to a sum, and in which array it stands.
LAST = (
    ("the bias", "bias"),
    ("a closed switch", "switch_rows"),
    ("a missing switch", "switch_means"),
    ("a bin", "joint_rows"),
    ("a missing joint", "joint_means"),
)


def edges(full: bool) -> Iterator[Finding]:
    """Hold tables whose sums reach 32767 and those that reach one more, the one too far by whatever can add it."""
    right = Worst("sums of exactly +-32767", "accepted, and added up without a spill", 0, "tables")
    wrong = Worst("sums of 32768", "refused, in memory and as a file", 0, "tables")
    for sign, classes, (name, arrays) in product((1, -1), (2, 3, MAX_CLASSES if full else 33), LAST):
        tables = edge_tables(classes, sign, arrays)
        at = f"{classes} classes, {'+' if sign > 0 else '-'} by {name}"
        right.see(float(not _is_right(tables, sign)), at)
        wrong.see(float(not _is_refused(tables, arrays, sign)), at)
    yield right.finding()
    yield wrong.finding()


def edge_tables(classes: int, sign: int, last: str) -> IntegerTables:
    """Return tables of one switch and one joint in which class 1 gets to 32767 steps by what stands in `last`.

    Its neighbours get as far the other way, so that a spill into the next lane would show.
    """
    arrays = {name: np.zeros((1, classes), np.int16) for _, name in LAST}
    towards = np.full(classes, -sign)
    towards[1] = sign
    arrays["bias"][0] = towards * (LIMIT - 1)
    arrays[last][0] += towards.astype(np.int16)
    return IntegerTables(
        bias=arrays["bias"][0],
        switch_rows=arrays["switch_rows"],
        thresholds=(np.array([100], np.uint16),),
        joint_rows=(np.vstack([arrays["joint_rows"], 0 * towards]).astype(np.int16),),
        switch_means=arrays["switch_means"],
        joint_means=arrays["joint_means"],
        scale=1.0,
    )


def _is_right(tables: IntegerTables, sign: int) -> bool:
    read = tables_from_bytes(tables_to_bytes(tables))
    found = furthest(read)
    lanes = Scorer(read).lanes_without(found.bits, found.codes, found.lost_switches, found.lost_joints)
    expected = [LANE_OFFSET + (LIMIT if k == 1 else -LIMIT) * sign for k in range(tables.n_classes)]
    return read.bound == LIMIT and list(lanes) == expected


def _is_refused(tables: IntegerTables, last: str, sign: int) -> bool:
    row = tables.joint_rows[0] if last == "joint_rows" else getattr(tables, last)
    if last == "bias" and sign > 0:
        row = tables.switch_rows  # 32768 is no int16: the step too many comes from elsewhere
    row[..., 1].flat[0] += sign
    altered = tables_to_bytes(tables)
    return _refuses(lambda: replace(tables)) and _refuses(lambda: tables_from_bytes(altered))


def _refuses(make: Callable[[], IntegerTables]) -> bool:
    try:
        make()
    except BuildError:
        return True
    return False
