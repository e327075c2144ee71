"""The classifier in AVR assembly: which registers hold the sums, and where each look-up finds its row."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import product

from . import FirmwareError
from .layout import Field, Layout, Lookup, lookups
from .words import Names, comment, switches_in_words

# Free to use for a C function, and to be kept for its caller.
_FREE, _KEPT = (18, 20, 22, 24, 26), (28, 16, 14, 12, 10, 8, 6, 4, 2)
_IMMEDIATE = 16  # registers from here on can be loaded with a constant
_LPM_REACH = 65536
# rcall reaches 4 KiB either way; all that update() does about a look-up must stay within that.
_NEAR_BYTES = 3600
_LOOKUP_BYTES = 104  # of the longest kind


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
    put_together = 2 * sum(len(group_lines("", fields)) + len(fields) for fields in layout.fields)
    return (_LOOKUP_BYTES * layout.n_lookups + put_together) * len(layout.parts.firsts) < _NEAR_BYTES


_MOST_MOVES, _BYTE = 4, range(8)


@lru_cache(maxsize=512)
def _moved(bit: int, width: int, to: int) -> tuple[str, ...]:
    """Return the fewest instructions that bring `width` bits of a register from `bit` to `to` and clear all others;
    `{}` is the register.
    """

    def after(moves: tuple[str, ...], place: int) -> int | None:
        for move in moves:
            place = (place + 4) % 8 if move == "swap" else place + (1 if move == "lsl" else -1)
            if place not in _BYTE:
                return None
        return place

    wanted = dict(zip(range(bit, bit + width), range(to, to + width), strict=True))
    found: list[tuple[str, ...]] = []
    for count in range(_MOST_MOVES + 1):
        for moves in product(("swap", "lsl", "lsr"), repeat=count):
            places = {place: after(moves, place) for place in _BYTE}
            if all(places[place] == end for place, end in wanted.items()):
                others = any(end is not None for place, end in places.items() if place not in wanted)
                mask = (f"andi  {{}}, {((1 << width) - 1) << to:#04x}",) if others else ()
                found.append((*(f"{move:<5} {{}}" for move in moves), *mask))
    return min(found, key=len)


def group_lines(name: str, fields: Sequence[Field]) -> list[str]:
    """Return the instructions that make the byte of a group of its first port's byte, in r30; r31 is theirs to use."""
    first, *others = fields
    lines = [line.format("r30") for line in _moved(first.bit, first.width, first.to)]
    for field in others:
        lines.append(f"lds   r31, thenar_{name}_input + {field.port}")
        moved = [line.format("r31") for line in _moved(field.bit, field.width, field.to)]
        if 2 * field.width <= len(moved) + 1:
            for bit in range(field.width):
                lines += [f"sbrc  r31, {field.bit + bit}", f"ori   r30, {1 << (field.to + bit):#04x}"]
        else:
            lines += [*moved, "or    r30, r31"]
    return lines


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
        "n_seen": layout.n_lookups,
        "tables": [
            (f"thenar_{name}_rows", layout.n_rows * len(parts.firsts) * stride),
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
        "last": number == len(parts.firsts) - 1,
    }


def _step(name: str, names: Names, layout: Layout, part: int, lookup: Lookup) -> Row:
    """Return one look-up: what it is of, its first byte in the input and what makes the row's number of a group's
    (`extract`), the offset of its rows in bytes, its kind ("byte": the byte is the row's number; else it is a joint's
    code), and whether it is `coded`: codes are then compared, which is faster than finding their rows.
    """
    rows = (part * layout.n_rows + lookup.first_row) * layout.parts.width * layout.entry_bits // 8
    if lookup.joint is None:
        fields = layout.fields[lookup.number]
        extract = group_lines(name, fields)
        what = switches_in_words(layout.groups[lookup.number])
        source = f"thenar_{name}_input + {fields[0].port}"
    else:
        extract = []
        what = comment(names.joints[lookup.number].name)
        codes = len(layout.ports) + layout.padding
        source = f"thenar_{name}_input + {codes + lookup.number * layout.code_bits // 8}"
        if layout.bins == "search":
            source = f"thenar_{name}_found + {lookup.index - len(layout.groups)}"
    step: Row = {"index": lookup.index, "what": what, "group": lookup.joint is None, "source": source, "rows": rows}
    step["extract"] = extract
    if lookup.joint is None or layout.bins == "search":
        return {**step, "kind": "byte", "coded": False}
    first, last, wide = lookup.joint.first, len(lookup.joint.bins) - 1, layout.code_bits == 16
    below, above = first > 0, first + last < (1 << layout.code_bits) - 1
    bins = {"bins": lookup.first_bin, "first": first, "last": last, "lower": below, "upper": above, "wide": wide}
    return {**step, **bins, "kind": layout.bins, "coded": not wide}
