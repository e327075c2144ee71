"""The classifier in AVR assembly: which registers hold the sums, and where each look-up finds its row."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise, product
from typing import cast

from . import FirmwareError
from .layout import Field, JointLayout, Layout, Lookup, looked_up
from .words import Names, comment, switches_in_words

# Free to use for a C function, and to be kept for its caller; of pairs the lower.
_FREE, _KEPT = (22, 24, 26, 18, 20), (16, 14, 12, 10, 8, 6, 4, 2, 28)
# Finding a row needs r0, r1, Z and Y, which points at the glove; of a wide code also zero in r19:r18, or r20, which
# compares.
_POINTER, _ZERO, _COMPARED = 28, 18, 20
_IMMEDIATE = 16  # registers from here on can be loaded with a constant
_LPM_REACH = 65536
FLAGS = 2  # bytes of a glove from where Y points to its input
MOST_DISTANCE = 255  # that a byte holds
_REACH = 63  # of ldd, and of adiw


Row = dict[str, object]  # of the template's lists


def check_size(layout: Layout) -> None:
    """Raise FirmwareError if the tables alone are more than an AVR's lpm can reach."""
    parts = layout.parts
    entries = layout.n_rows * parts.width * len(parts.firsts)
    needed = entries * layout.entry_bits // 8 + sum(len(joint.bins) for joint in layout.joints)
    if needed > _LPM_REACH:
        raise FirmwareError(f"the tables need {needed} bytes, an AVR reads constants from the first {_LPM_REACH} bytes")


def assembly_values(name: str, names: Names, layout: Layout, *, near: bool) -> dict[str, object]:
    """Return what the template of the assembly asks for; `near`: calls are `rcall`, not `call`."""
    parts = layout.parts
    stride = parts.width * layout.entry_bits // 8
    passes = [_pass(names, layout, number) for number in range(len(parts.firsts))]
    bins = sum(len(joint.bins) for joint in layout.joints)
    return {
        "byte_sums": layout.sum_bits == 8,
        "wide": layout.code_bits == 16,
        "zeros": _ZERO in _spare(layout),
        "unrolled": layout.adding == "unrolled",
        "finds_first": finds_first(layout),
        "compares": compares_input(layout),
        "call": "rcall" if near else "call",
        "jump": "rjmp" if near else "jmp",
        "passes": passes,
        "sums": passes[0]["sums"],
        "stride": stride,
        "frame_size": layout.frame_size,
        "kept": kept_registers(layout),
        "last": last_size(layout),
        "seen": seen_size(layout),
        "sources": FLAGS + layout.frame_size + _n_found(layout),
        "halves": layout.entry_shift == 8,
        "clean": layout.biased and not layout.entry_shift,  # r1 is zero between look-ups
        "tables": [
            *([(f"thenar_{name}_rows", layout.n_rows * len(parts.firsts) * stride)] if layout.n_rows else []),
            *([(f"thenar_{name}_bins", bins)] if bins else []),
        ],
    }


def finds_first(layout: Layout) -> bool:
    """Return whether classify() finds all rows before it adds any: where classes are added up in parts, or where their
    sums leave no registers to find rows with.
    """
    return len(layout.parts.firsts) > 1 or bool(_pairs(layout) & _spare(layout))


def compares_input(layout: Layout) -> bool:
    """Return whether update() compares the input before it finds rows; if not, it finds all rows and compares those.

    That takes more time if few codes change, but less flash. Wide codes, which change with every bit of noise, are only
    compared where flash is spent on speed.
    """
    return layout.adding == "unrolled" or layout.code_bits == 8


def compared_bytes(layout: Layout, lookup: Lookup) -> list[int]:
    """Return the places in the frame of the bytes of input that update() compares, to know whether a look-up's row may
    be another: none of a group of switches alone, whose row is made of few bits.
    """
    if not lookup.joints or not compares_input(layout):
        return []
    ports = [] if lookup.group is None else [field.port for field in layout.fields[lookup.group]]
    return [*dict.fromkeys(ports), *(place for joint in lookup.joints for place in _code_bytes(layout, joint.number))]


def _compared_of_slope(layout: Layout, joint: int) -> list[int]:
    return _code_bytes(layout, joint) if compares_input(layout) else []


def found_size(layout: Layout) -> int:
    """Return the bytes that hold what classify() has found, where it finds first."""
    return max(_n_found(layout), 1) if finds_first(layout) else 0


def seen_size(layout: Layout) -> int:
    """Return the bytes that say what is in the sums of update(): the distances of slopes, the rows of look-ups, and the
    input that these were found from.
    """
    codes = sum(len(compared_bytes(layout, lookup)) for lookup in layout.lookups)
    codes += sum(len(_compared_of_slope(layout, slope.joint)) for slope in layout.tables.slopes)
    return max(_n_found(layout) + codes, 1)


def _n_found(layout: Layout) -> int:
    return len(layout.lookups) + len(layout.tables.slopes)


def glove_size(layout: Layout) -> int:
    """Return the bytes of a glove on an AVR: scores, what they begin with, FLAGS, the input, and what is private."""
    lost = len(layout.ports) + -(-layout.tables.n_joints // 8) + 2
    return 4 * layout.tables.n_classes + FLAGS + layout.frame_size + seen_size(layout) + lost


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


def far(place: int, *, wide: bool = False) -> int:
    """Return whether the glove's byte at that place from its input on is within the reach of Y (0), within reach of a
    short move of Y (1), or beyond (2).
    """
    at = FLAGS + place + wide
    return (at > _REACH) + (at > 2 * _REACH)


def _at(place: int, transfer: str, registers: Sequence[int]) -> list[str]:
    """Return the instructions that load registers from that place on, or store them there (`transfer`). Y points FLAGS
    bytes before the input; it is moved, and moved back, for what is beyond its reach.
    """
    at = FLAGS + place
    base = (0, _REACH, at)[far(place, wide=len(registers) > 1)]
    before, after = [f"adiw  r28, {base}"], [f"sbiw  r28, {base}"]
    if base > _REACH:
        before, after = ([f"subi  r28, lo8({each})", f"sbci  r29, hi8({each})"] for each in (-base, base))
    moved = [transfer.format(register=each, place=at - base + more) for more, each in enumerate(registers)]
    return [*before, *moved, *after] if base else moved


def taken(place: int, register: int, *, wide: bool = False) -> list[str]:
    """Return the instructions that load the input at that place in the frame, a wide one into two registers."""
    return _at(place, "ldd   r{register}, Y+{place}", range(register, register + 1 + wide))


def found_place(layout: Layout, number: int) -> int:
    """Return where the byte is that says what update() has found for a slope, or then for a look-up."""
    return layout.frame_size + number


def _exchange(layout: Layout, number: int) -> Row:
    """Return the instructions that load what was found before into r31, and those that store r30 in its place."""
    place = found_place(layout, number)
    return {"before_in_r31": taken(place, 31), "store_r30": _at(place, "std   Y+{place}, r{register}", [30])}


def group_lines(fields: Sequence[Field]) -> list[str]:
    """Return the instructions that make the byte of a group of its fields' ports in r30; r31 is theirs to use, r0 and
    r1 are not.
    """
    lines: list[str] = []
    for field in fields:
        register = "r31" if lines else "r30"
        moved = [line.format(register) for line in _moved(field.bit, field.width, field.to)]
        one_by_one = register == "r31" and 2 * field.width <= len(moved) + 1
        lines += taken(field.port, int(register[1:]))
        if one_by_one:
            for bit in range(field.width):
                lines += [f"sbrc  r31, {field.bit + bit}", f"ori   r30, {1 << (field.to + bit):#04x}"]
        else:
            lines += [*moved, *(["or    r30, r31"] if register == "r31" else [])]
    return lines


def _spare(layout: Layout) -> set[int]:
    """Return the registers that are needed to find rows; of pairs the lower."""
    if layout.code_bits == 8 or not looked_up(layout.tables):
        return {_POINTER}
    return {_POINTER, _COMPARED if layout.bins == "search" else _ZERO}


def _registers(layout: Layout) -> list[int]:
    """Return the registers of the sums of a pass; of pairs the lower. Those that finding rows needs are the last to be
    taken.
    """
    spare = _spare(layout)
    pairs = sorted((*_FREE, *_KEPT), key=lambda low: (low == _POINTER, low in spare))
    found = pairs if layout.sum_bits == 16 else [low + half for low in pairs for half in (0, 1)]
    return sorted(found[: layout.parts.width])


def _pairs(layout: Layout) -> set[int]:
    """Return the pairs of registers that hold sums; the lower of each."""
    return {register // 2 * 2 for register in _registers(layout)}


def borrows(layout: Layout, lookup: Lookup) -> bool:
    """Return whether update() must save a sum while it finds a row: it compares wide codes with thresholds."""
    compares = layout.code_bits == 16 and any(joint.compared for joint in lookup.joints)
    return compares and _COMPARED in _registers(layout)


def last_size(layout: Layout) -> int:
    """Return the bytes of the sums of update() that stay in memory while Y points at the glove."""
    return sum(each // 2 * 2 == _POINTER for each in _registers(layout)) * layout.sum_bits // 8


def kept_registers(layout: Layout) -> list[int]:
    """Return the registers that are saved: because they hold sums, and because Y points at the glove."""
    halves = (0, 1) if layout.sum_bits == 16 else (0,)
    sums = {low + half for low in _registers(layout) for half in halves if low // 2 * 2 in _KEPT}
    return sorted(sums | {_POINTER, _POINTER + 1})


def _pass(names: Names, layout: Layout, number: int) -> Row:
    """Return a pass over all look-ups for some classes: their sums, each in a register or in a pair from `low` on,
    their place among the scores in bytes, and how many of them, the first ones, are in the pass before as well. While
    Y points at the glove, the sums in `spilled`, which are the last, stay in memory.
    """
    parts = layout.parts
    first = parts.firsts[number]
    starts = layout.start[first : first + parts.width].tolist()
    grasps = map(comment, names.grasps[first : first + parts.width])
    high = int(layout.sum_bits == 16)
    steps = [_step(names, layout, lookup, number) for lookup in layout.lookups]
    slopes = [_slope(names, layout, at, first) for at in range(len(layout.tables.slopes))]
    before = 0
    for each in (*steps, *slopes):
        each["before"] = before  # where the bytes of input that it was found from begin
        before += len(cast("list[Row]", each["compared_bytes"]))
    sums = [
        {"low": low, "high": low + high, "start": start, "grasp": grasp, "immediate": low >= _IMMEDIATE}
        for low, start, grasp in zip(_registers(layout), starts, grasps, strict=True)
    ]
    held = [low for low in _registers(layout) if low < _POINTER]
    return {
        "number": number,
        "sums": sums,
        "held": sums[: len(held)],
        "spilled": sums[len(held) :],
        "scores": 2 * first,
        "again": parts.firsts[number - 1] + parts.width - first if number else 0,
        "steps": steps,
        "slopes": slopes,
        "last": number == len(parts.firsts) - 1,
    }


def _code_bytes(layout: Layout, joint: int) -> list[int]:
    """Return the places in the frame of the bytes of a joint's code."""
    each = layout.code_bits // 8
    first = len(layout.ports) + layout.padding + joint * each
    return [*range(first, first + each)]


def _loaded(places: Sequence[int]) -> list[list[str]]:
    """Return for each byte of input the instructions that load it into r0."""
    return [taken(place, 0) for place in places]


def _code(layout: Layout, joint: int) -> list[str]:
    """Return the instructions that load a joint's code, into r30 or r31:r30."""
    return taken(_code_bytes(layout, joint)[0], 30, wide=layout.code_bits == 16)


def _slope(names: Names, layout: Layout, at: int, first: int) -> Row:
    """Return a slope: how its code is loaded, held within its range and scaled, and what it multiplies: entries, each
    with the sums that it is added to, or subtracted from.
    """
    slope, registers = layout.tables.slopes[at], _registers(layout)
    return {
        "at": at,
        "what": comment(names.joints[slope.joint].name),
        "taken": _code(layout, slope.joint),
        "compared_bytes": _loaded(_compared_of_slope(layout, slope.joint)),
        **_exchange(layout, at),
        "low": slope.low,
        "span": slope.high - slope.low,
        "long": slope.high - slope.low > MOST_DISTANCE,
        "upper": slope.high < (1 << layout.code_bits) - 1,
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


def _step(names: Names, layout: Layout, lookup: Lookup, part: int) -> Row:
    """Return a look-up in the pass for the classes of a part: what it is of, how the number of its row is made of the
    input, which register has it then, how each byte of that input is loaded into r0, and where its rows begin.
    """
    compared = [joint for joint in reversed(lookup.joints) if joint.compared]
    trimmed = [joint for joint in lookup.joints if not joint.compared]
    grouped = lookup.group is not None
    weights = [joint.weight for joint in compared]
    factors = [before // weight for before, weight in pairwise(weights)]
    groups = [] if lookup.group is None else [switches_in_words(layout.groups[lookup.group])]
    group = [] if lookup.group is None else group_lines(layout.fields[lookup.group])
    return {
        "index": lookup.index,
        "what": ", ".join([*groups, *(comment(names.joints[joint.number].name) for joint in lookup.joints)]),
        "rows": (part * layout.n_rows + lookup.first_row) * layout.parts.width * layout.entry_bits // 8,
        "compared_bytes": _loaded(compared_bytes(layout, lookup)),
        **_exchange(layout, len(layout.tables.slopes) + lookup.index),
        "one_group": not lookup.joints,
        "compared": [
            {
                "taken": _code(layout, joint.number),
                "times": times,
                "steps": (joint.thresholds.astype(int) + 1).tolist(),
            }
            for joint, times in zip(compared, [1, *factors], strict=False)
        ],
        "times": weights[-1] if weights else 1,
        "trimmed": [
            {"taken": _code(layout, joint.number), **_bins(layout, joint), "how": how}
            for joint, how in zip(trimmed, _adding(len(trimmed), bool(compared), grouped), strict=True)
        ],
        "group": group,
        "borrows": borrows(layout, lookup),
        "register": 30 if trimmed or grouped else 0,
    }


def _bins(layout: Layout, joint: JointLayout) -> Row:
    first, last = joint.first, len(joint.bins) - 1
    return {
        "bins": joint.first_bin,
        "first": first,
        "last": last,
        "lower": first > 0,
        "upper": first + last < (1 << layout.code_bits) - 1,
        "paged": layout.bins == "direct",
    }


def _adding(count: int, before: bool, after: bool) -> list[str]:
    """Return what is done with each of `count` numbers in r30, that are added up in r0 and in the end in r30; whether
    there is one in r0 before, and whether one comes after.
    """
    last = [] if after else ["add   r30, r0" if count > 1 or before else ""]
    rest = ["add   r0, r30"] * (count - len(last) if count else 0)
    if rest and not before:
        rest[0] = "mov   r0, r30"
    return [*rest, *last][:count]
