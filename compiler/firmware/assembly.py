"""The classifier in AVR assembly: which registers hold the sums, and where each look-up finds its row."""

from collections.abc import Sequence

from . import FirmwareError
from .layout import Layout, Lookup, lookups
from .words import Names, comment

# Free to use for a C function, and to be kept for its caller.
_FREE, _KEPT = (18, 20, 22, 24, 26), (28, 16, 14, 12, 10, 8, 6, 4, 2)
_IMMEDIATE = 16  # registers from here on can be loaded with a constant
_LPM_REACH = 65536
# rcall reaches 4 KiB either way; all that update() does about a look-up must stay within that.
_NEAR_BYTES = 3600
_LOOKUP_BYTES = 104  # of the longest kind
_SLOPE_BYTES = 80  # but for its products, which no near call reaches across


Row = dict[str, object]  # of the template's lists


def check_size(layout: Layout) -> None:
    """Raise FirmwareError if the tables alone are more than an AVR's lpm can reach."""
    parts = layout.parts
    entries = layout.n_rows * parts.width * len(parts.firsts)
    needed = entries * layout.entry_bits // 8 + sum(len(joint.bins) for joint in layout.joints)
    if needed > _LPM_REACH:
        raise FirmwareError(f"the tables need {needed} bytes, an AVR reads constants from the first {_LPM_REACH} bytes")


def calls_are_near(layout: Layout) -> bool:
    """Return whether all calls are `rcall`; else they are `call`, a word and a cycle more."""
    passes = len(layout.parts.firsts)
    each = _LOOKUP_BYTES * layout.n_lookups + _SLOPE_BYTES * len(layout.tables.slopes)
    return each * passes < _NEAR_BYTES


def assembly_values(name: str, names: Names, layout: Layout) -> dict[str, object]:
    """Return what the template of the assembly asks for."""
    near, parts = calls_are_near(layout), layout.parts
    registers = sorted((_FREE + _KEPT)[: parts.width])
    passes = [_pass(name, names, layout, number, registers) for number in range(len(parts.firsts))]
    stride = parts.width * layout.entry_bits // 8
    searched = layout.bins == "search" and any(not joint.constant for joint in layout.joints)
    bins = sum(len(joint.bins) for joint in layout.joints if not joint.constant)
    return {
        "classify": "add_up" if searched else "classify",
        "update": "add_changes" if searched else "update",
        "unrolled": layout.adding == "unrolled",
        "call": "rcall" if near else "call",
        "jump": "rjmp" if near else "jmp",
        "passes": passes,
        "sums": passes[0]["sums"],
        "stride": stride,
        "kept": [register + half for register in registers if register in _KEPT for half in (0, 1)],
        "n_seen": layout.n_lookups + len(layout.tables.slopes),
        "halves": layout.entry_shift == 8,
        "clean": keeps_zero(layout),
        "tables": [
            *([(f"thenar_{name}_rows", layout.n_rows * len(parts.firsts) * stride)] if layout.n_rows else []),
            *([(f"thenar_{name}_bins", bins)] if bins else []),
        ],
    }


def _pass(name: str, names: Names, layout: Layout, number: int, registers: Sequence[int]) -> Row:
    """Return a pass over all look-ups for some classes: their sums, each in a pair of registers from `low` on, their
    place among the scores in bytes, and how many of them, the first ones, are in the pass before as well.
    """
    parts = layout.parts
    first = parts.firsts[number]
    starts = layout.start[first : first + parts.width].tolist()
    grasps = map(comment, names.grasps[first : first + parts.width])
    return {
        "number": number,
        "sums": [
            {"low": low, "start": start, "grasp": grasp, "immediate": low >= _IMMEDIATE}
            for low, start, grasp in zip(registers, starts, grasps, strict=True)
        ],
        "scores": 2 * first,
        "again": parts.firsts[number - 1] + parts.width - first if number else 0,
        "steps": [_step(name, names, layout, number, lookup) for lookup in lookups(layout)],
        "slopes": [_slope(name, names, layout, at, first, registers) for at in range(len(layout.tables.slopes))],
        "last": number == len(parts.firsts) - 1,
    }


def keeps_zero(layout: Layout) -> bool:
    """Return whether r1 is zero between look-ups: plain bytes are added with the carry alone."""
    return layout.entry_bits == 8 and not layout.entry_shift


def _slope(name: str, names: Names, layout: Layout, at: int, first: int, registers: Sequence[int]) -> Row:
    """Return a slope: its code in the input, how that is held within its range and scaled, and what it multiplies:
    entries, each with the sums that it is added to, or subtracted from.
    """
    slope, bits = layout.tables.slopes[at], layout.code_bits
    place = len(layout.groups) + layout.padding + slope.joint * bits // 8
    return {
        "index": layout.n_lookups + at,
        "what": comment(names.joints[slope.joint].name),
        "source": f"thenar_{name}_input + {place}",
        "wide": bits == 16,
        "low": slope.low,
        "span": slope.high - slope.low,
        "upper": slope.high < (1 << bits) - 1,
        "doubled": max(slope.gain, 0),
        "halved": max(-slope.gain, 0),
        "zero": slope.zero,
        "entries": [
            (entry, [(registers[k], alike) for k, alike in sums])
            for entry, sums in products(slope.row[first : first + len(registers)].tolist())
        ],
    }


def products(row: Sequence[int]) -> list[tuple[int, list[tuple[int, bool]]]]:
    """Return what a slope's row multiplies: each entry that is not zero, but for those that are equal to another or its
    negative, and the classes that it is of, with whether it is theirs or its negative is.
    """
    found: dict[int, list[int]] = {}
    for k, entry in enumerate(row):
        if entry:
            found.setdefault(abs(entry), []).append(k)
    return [(row[classes[0]], [(k, row[k] == row[classes[0]]) for k in classes]) for classes in found.values()]


def _step(name: str, names: Names, layout: Layout, part: int, lookup: Lookup) -> Row:
    """Return one look-up: what it is of, its byte in the input, the offset of its rows in bytes, its kind ("byte": the
    byte is the row's number; else it is a joint's code), and whether it is `coded`: codes are then compared, which is
    faster than finding their rows.
    """
    rows = (part * layout.n_rows + lookup.first_row) * layout.parts.width * layout.entry_bits // 8
    if lookup.joint is None:
        numbers = layout.groups[lookup.number]
        what, source = f"switches {numbers[0]} to {numbers[-1]}", f"thenar_{name}_input + {lookup.number}"
    else:
        what = comment(names.joints[lookup.number].name)
        codes = len(layout.groups) + layout.padding
        source = f"thenar_{name}_input + {codes + lookup.number * layout.code_bits // 8}"
        if layout.bins == "search":
            source = f"thenar_{name}_found + {lookup.index - len(layout.groups)}"
    step: Row = {"index": lookup.index, "what": what, "group": lookup.joint is None, "source": source, "rows": rows}
    if lookup.joint is None or layout.bins == "search":
        return {**step, "kind": "byte", "coded": False}
    first, last, wide = lookup.joint.first, len(lookup.joint.bins) - 1, layout.code_bits == 16
    below, above = first > 0, first + last < (1 << layout.code_bits) - 1
    bins = {"bins": lookup.first_bin, "first": first, "last": last, "lower": below, "upper": above, "wide": wide}
    return {**step, **bins, "kind": layout.bins, "coded": not wide}
