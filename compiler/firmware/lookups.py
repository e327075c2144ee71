"""The look-ups of a layout in the order in which they are made, with the place of each in the tables."""

from collections.abc import Iterator
from dataclasses import dataclass

from .joint_layout import JointLayout
from .layout import Layout, Rows


@dataclass(frozen=True, slots=True, eq=False)
class Lookup:
    """One row added per frame.

    `index` counts the look-ups, `number` the groups or, where `joint` is given, all joints; the rows begin at row
    `first_row` of the table, and a joint's bins at byte `first_bin` of the bins, or its thresholds at that threshold.
    """

    index: int
    number: int
    first_row: int
    rows: Rows
    joint: JointLayout | None = None
    first_bin: int = 0


def lookups(layout: Layout) -> Iterator[Lookup]:
    """Yield the groups of switches and then the joints that have thresholds."""
    index = first_row = first_bin = 0
    for number, rows in enumerate(layout.group_rows):
        yield Lookup(index, number, first_row, rows)
        index, first_row = index + 1, first_row + len(rows)
    for number, joint in enumerate(layout.joints):
        if joint.constant:
            continue
        yield Lookup(index, number, first_row, joint.rows, joint, first_bin)
        index, first_row = index + 1, first_row + len(joint.rows)
        first_bin += len(joint.thresholds) if layout.bins == "search" else len(joint.bins)
