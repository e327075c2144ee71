"""The tables of `placement.py`: the results of each placement compared with the paper's."""

from collections.abc import Sequence

from placementlines import MOST, SHOWN, WITHIN, Line, Point
from rich.table import Table

from thenar.compiler.placement.methods.base import METHODS


def saved(lines: Sequence[Line], joints: bool, paper: Point) -> Table:
    """Return the table of smallest placements within half a point of the paper's accuracy."""
    title = f"{kind(joints)}: fewest switches within {100 * WITHIN:g} points of the paper's"
    times = ("scan, new glove, us", "less", "as wired, us", "less")
    table = Table("method", "switches", "accuracy, %", "fewer switches", *times, title=title)
    cells = (f"{paper.size:.1f}", f"{100 * paper.rate:.2f}", "", f"{paper.new_us:.0f}", "", f"{paper.wired_us:.0f}", "")
    table.add_row("the paper's pruned ID3", *cells, end_section=True)
    for line in lines:
        if line.joints != joints or not METHODS[line.method].ours:
            continue
        point = line.smallest
        if point is None:
            table.add_row(line.method, f"none up to {MOST}", f"{100 * line.shown[-1].rate:.2f} at {SHOWN[joints][-1]}")
            continue
        fewer = f"{1 - point.size / paper.size:.0%}"
        new = (f"{point.new_us:.0f}", f"{1 - point.new_us / paper.new_us:.0%}")
        wired = (f"{point.wired_us:.0f}", f"{1 - point.wired_us / paper.wired_us:.0%}")
        table.add_row(line.method, f"{point.size:.1f}", f"{100 * point.rate:.2f}", fewer, *new, *wired)
    return table


def compared(lines: Sequence[Line], joints: bool) -> Table:
    """Return the table of rates at given numbers of switches; numbers that a tree misses are added in brackets."""
    heads = (f"{size} switches, %" for size in SHOWN[joints])
    table = Table("method", *heads, "seconds to choose", title=kind(joints))
    for line in lines:
        if line.joints == joints:
            cells = (cell(point, size) for point, size in zip(line.shown, SHOWN[joints], strict=True))
            table.add_row(line.method, *cells, f"{line.seconds:.1f}")
    return table


def cell(point: Point, size: int) -> str:
    """Return a rate, with the mean number of switches if it differs from `size`."""
    return f"{100 * point.rate:.2f}" + ("" if point.size == size else f" ({point.size:.1f})")


def kind(joints: bool) -> str:
    """Return the inputs, in words."""
    return "switches and joints" if joints else "switches only"
