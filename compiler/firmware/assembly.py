"""The classifier in AVR assembly: which registers hold the sums, and how each lookup finds its row."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import accumulate, chain, pairwise, product
from typing import NamedTuple

from . import FirmwareError
from .layout import Field, JointLayout, Layout, Lookup, looked_up
from .words import Names, comment, switches_in_words

# Call-clobbered and call-saved register pairs, each named by its lower register.
_FREE, _KEPT = (22, 24, 26, 18, 20), (16, 14, 12, 10, 8, 6, 4, 2, 28)
# Finding a row needs r0, r1, Z, and Y, which points at the glove. With 16-bit codes it also needs r20 for comparisons.
_POINTER, _COMPARED = 28, 20
_IMMEDIATE = 16  # registers from here on can be loaded with a constant
_LPM_REACH = 65536
_TEMPLATES = "classifier/avr/"
_SIZES = {8: "bytes", 16: "words"}
FLAGS = 2  # bytes between the address in Y and the glove's input
MOST_DISTANCE = 255  # the largest distance that fits in a byte
_REACH = 63  # of ldd, and of adiw


Row = dict[str, object]  # of the template's lists


def check_size(layout: Layout) -> None:
    """Raise FirmwareError if the tables alone are more than an AVR's lpm can reach."""
    parts = layout.parts
    entries = layout.n_rows * parts.width * len(parts.firsts)
    needed = entries * layout.entry_bits // 8 + sum(len(joint.bins) for joint in layout.joints)
    if needed > _LPM_REACH:
        raise FirmwareError(f"the tables need {needed} bytes, an AVR reads constants from the first {_LPM_REACH} bytes")


def assembly_values(name: str, names: Names, layout: Layout) -> dict[str, object]:
    """Return the values for the assembly template."""
    parts, seen = layout.parts, seen_inputs(layout)
    stride = parts.width * layout.entry_bits // 8
    passes = [_pass(names, layout, number, seen) for number in range(len(parts.firsts))]
    bins = sum(len(joint.bins) for joint in layout.joints)
    return {
        "byte_sums": layout.sum_bits == 8,
        "way": f"{_TEMPLATES}{'found_first' if finds_first(layout) else 'at_once'}",
        "entries": _entries(layout),
        "sum_macros": f"{_TEMPLATES}sums_{_SIZES[layout.sum_bits]}.j2",
        "code_macros": f"{_TEMPLATES}codes_{_SIZES[layout.code_bits]}.j2",
        "finds_first": finds_first(layout),
        "compares": compares_input(layout),
        "passes": passes,
        "sums": passes[0]["sums"],
        "stride": stride,
        "frame_size": layout.frame_size,
        "kept": kept_registers(layout),
        "last": last_size(layout),
        "seen": seen_size(layout),
        "clean": layout.biased and not layout.entry_shift,  # r1 is zero between lookups
        "tables": [
            *([(f"thenar_{name}_rows", layout.n_rows * len(parts.firsts) * stride)] if layout.n_rows else []),
            *([(f"thenar_{name}_bins", bins)] if bins else []),
        ],
    }


def _entries(layout: Layout) -> str:
    """Return the macro of entries.j2 that adds and subtracts the layout's rows."""
    if layout.biased:
        return "halves" if layout.entry_shift else "offsets"
    return _SIZES[layout.entry_bits]


def finds_first(layout: Layout) -> bool:
    """Return whether classify() finds all rows before it adds any: the classes need several passes, or their sums leave
    no registers for finding rows.
    """
    return len(layout.parts.firsts) > 1 or bool(_pairs(layout) & _spare(layout))


def compares_input(layout: Layout) -> bool:
    """Return whether update() compares the input before it finds rows. Otherwise it finds all rows and compares those,
    since sensor noise changes most 16-bit codes in every frame.
    """
    return layout.code_bits == 8


class Seen(NamedTuple):
    """The byte of a port, or a code of `size` bytes, at the offset `now` of the input, and its previous value."""

    now: int
    before: int
    size: int


def seen_inputs(layout: Layout) -> dict[int, list[Seen]]:
    """Return for each slope and lookup, numbered as in `found_place`, the inputs that update() compares to decide
    whether a distance or a row may have changed. Lookups of switches alone have none: their row numbers are cheap to
    compute.
    """
    if not compares_input(layout):
        return {}
    places = [[_code_place(layout, slope.joint)] for slope in layout.tables.slopes]
    places += [_lookup_places(layout, lookup) for lookup in layout.lookups]
    before, found = found_place(layout, _n_found(layout)), {}
    for number, own in enumerate(places):
        sizes = [1 if place < len(layout.ports) else layout.code_bits // 8 for place in own]
        kept = accumulate(sizes, initial=before)
        found[number] = [Seen(*each) for each in zip(own, kept, sizes, strict=False)]
        before += sum(sizes)
    return found


def _lookup_places(layout: Layout, lookup: Lookup) -> list[int]:
    return [_code_place(layout, joint.number) for joint in lookup.joints]


def seen_size(layout: Layout) -> int:
    """Return the size of the state of update(): the distances of slopes, the row numbers of lookups, and the compared
    input bytes.
    """
    return max(_n_found(layout) + sum(each.size for own in seen_inputs(layout).values() for each in own), 1)


def _n_found(layout: Layout) -> int:
    return len(layout.lookups) + len(layout.tables.slopes)


def glove_size(layout: Layout) -> int:
    """Return the size of a glove on an AVR: scores, initial scores, FLAGS, input and private state."""
    lost = len(layout.ports) + -(-layout.tables.n_joints // 8) + 2
    return 4 * layout.tables.n_classes + FLAGS + layout.frame_size + seen_size(layout) + lost


_MOST_MOVES, _BYTE = 4, range(8)


@lru_cache(maxsize=512)
def _moved(bit: int, width: int, to: int) -> tuple[str, ...]:
    """Return the shortest instruction sequence that moves `width` bits of a register from `bit` to `to` and clears the
    others; `{}` is the register.
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


_LOAD, _STORE = "ldd   r{register}, Y+{place}", "std   Y+{place}, r{register}"


def far(place: int, *, wide: bool = False) -> int:
    """Return how Y reaches an offset from the glove's input: directly (0), after one `adiw` (1), or after a 16-bit
    addition (2).
    """
    at = FLAGS + place + wide
    return (at > _REACH) + (at > 2 * _REACH)


def _at(place: int, transfer: str, registers: Sequence[int]) -> list[str]:
    """Return the instructions that load or store (`transfer`) registers at an offset from the input. Y points FLAGS
    bytes before the input; it is moved and restored if the offset is out of reach.
    """
    at = FLAGS + place
    base = (0, _REACH, at)[far(place, wide=len(registers) > 1)]
    before, after = [f"adiw  r28, {base}"], [f"sbiw  r28, {base}"]
    if base > _REACH:
        before, after = ([f"subi  r28, lo8({each})", f"sbci  r29, hi8({each})"] for each in (-base, base))
    moved = [transfer.format(register=each, place=at - base + more) for more, each in enumerate(registers)]
    return [*before, *moved, *after] if base else moved


def taken(place: int, register: int, *, wide: bool = False) -> list[str]:
    """Return the instructions that load the input at an offset in the frame, two bytes if `wide`."""
    return _at(place, _LOAD, range(register, register + 1 + wide))


def found_place(layout: Layout, number: int) -> int:
    """Return the offset of the distance of a slope, or of the row number of a lookup (numbered after the slopes)."""
    return layout.frame_size + number


def _exchange(layout: Layout, number: int) -> Row:
    """Return the instructions that load the previous row number or distance into r31, and that store r30 over it."""
    place = found_place(layout, number)
    return {"before_in_r31": taken(place, 31), "store_r30": _at(place, _STORE, [30])}


def group_lines(fields: Sequence[Field]) -> list[str]:
    """Return the instructions that assemble a group's byte in r30 from its fields. They may change r31, but not r0 or
    r1.
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
    """Return the register pairs that are needed to find rows, each by its lower register."""
    if layout.code_bits == 8 or not looked_up(layout.tables):
        return {_POINTER}
    return {_POINTER, _COMPARED}


def _registers(layout: Layout) -> list[int]:
    """Return the registers of the sums of a pass; of a pair the lower. Registers that finding rows needs are taken
    last.
    """
    spare = _spare(layout)
    pairs = sorted((*_FREE, *_KEPT), key=lambda low: (low == _POINTER, low in spare))
    found = pairs if layout.sum_bits == 16 else [low + half for low in pairs for half in (0, 1)]
    return sorted(found[: layout.parts.width])


def _pairs(layout: Layout) -> set[int]:
    """Return the register pairs that hold sums, each by its lower register."""
    return {register // 2 * 2 for register in _registers(layout)}


def borrows(layout: Layout, lookup: Lookup) -> bool:
    """Return whether update() must save r20, a sum, while it compares 16-bit codes with thresholds."""
    compares = layout.code_bits == 16 and any(joint.compared for joint in lookup.joints)
    return compares and _COMPARED in _registers(layout)


def last_size(layout: Layout) -> int:
    """Return the size of the sums that update() keeps in memory while Y points at the glove."""
    return sum(each // 2 * 2 == _POINTER for each in _registers(layout)) * layout.sum_bits // 8


def kept_registers(layout: Layout) -> list[int]:
    """Return the call-saved registers that are used: those with sums, and Y."""
    halves = (0, 1) if layout.sum_bits == 16 else (0,)
    sums = {low + half for low in _registers(layout) for half in halves if low // 2 * 2 in _KEPT}
    return sorted(sums | {_POINTER, _POINTER + 1})


def _pass(names: Names, layout: Layout, number: int, seen: Mapping[int, Sequence[Seen]]) -> Row:
    """Return a pass over all lookups for some classes.

    Each sum is in a register, or in a pair from `low` on; those in `spilled`, the last, stay in memory while Y points
    at the glove. `scores` is the byte offset of the first score; the first `again` classes are also in the pass before.
    """
    parts = layout.parts
    first = parts.firsts[number]
    starts = layout.start[first : first + parts.width].tolist()
    grasps = map(comment, names.grasps[first : first + parts.width])
    high = int(layout.sum_bits == 16)
    n_slopes = len(layout.tables.slopes)
    slopes = [_slope(names, layout, at, first, seen.get(at, ())) for at in range(n_slopes)]
    steps = [_step(names, layout, lookup, number, seen.get(n_slopes + lookup.index, ())) for lookup in layout.lookups]
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
        "back": f"jmp   back_{number}" if sums[len(held) :] else "ret",
        "last_bytes": [(_POINTER + at, 2 * len(held) + at * (2 - high)) for at in range(last_size(layout))],
        "scores": 2 * first,
        "again": parts.firsts[number - 1] + parts.width - first if number else 0,
        "steps": steps,
        "switches": [step for step in steps if step["kind"] == "switches"],
        "replaces": any(step["kind"] != "switches" for step in steps),
        "slopes": slopes,
        "last": number == len(parts.firsts) - 1,
    }


def _code_place(layout: Layout, joint: int) -> int:
    """Return the offset in the frame of a joint's code."""
    return len(layout.ports) + layout.padding + joint * layout.code_bits // 8


def _compared(seen: Sequence[Seen]) -> Row:
    """Return how update() loads inputs, a byte into r30 or a code into r31:r30, and the previous ones, into r31 or
    r1:r0.
    """
    compared = [
        {
            "wide": each.size > 1,
            "now": taken(each.now, 30, wide=each.size > 1),
            "before": taken(each.before, 0, wide=True) if each.size > 1 else taken(each.before, 31),
        }
        for each in seen
    ]
    return {"kind": "compared" if seen else "found", "compared_inputs": compared}


def _noted(each: Seen) -> list[str]:
    """Return the instructions that store an input in r30 or r31:r30 as the previous one."""
    return _at(each.before, _STORE, (30, 31)[: each.size])


def _taken(layout: Layout, joint: int, seen: Sequence[Seen]) -> Row:
    """Return the instructions that load a joint's code into r30 or r31:r30: always (`taken`), where update() has
    compared it (`retaken`: if it has compared nothing else, it is there already), and where it also stores it.
    """
    place = _code_place(layout, joint)
    load = taken(place, 30, wide=layout.code_bits == 16)
    again = [] if len(seen) == 1 else load
    return {
        "taken": load,
        "retaken": again,
        "noted": [*again, *chain(*(_noted(each) for each in seen if each.now == place))],
    }


def _slope(names: Names, layout: Layout, at: int, first: int, seen: Sequence[Seen]) -> Row:
    """Return a slope: how its code is loaded, clamped and scaled, and the entries that it multiplies, each with the
    sums that the product is added to or subtracted from.
    """
    slope, registers = layout.tables.slopes[at], _registers(layout)
    return {
        "at": at,
        "what": comment(names.joints[slope.joint].name),
        **_taken(layout, slope.joint, seen),
        **_compared(seen),
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
    """Return the distinct absolute values among the nonzero entries of a slope's row. With each come its classes, and
    whether the entry of a class equals the one returned or its negative.
    """
    found: dict[int, list[int]] = {}
    for k, entry in enumerate(row):
        if entry:
            found.setdefault(abs(entry), []).append(k)
    return [(row[classes[0]], [(k, row[k] == row[classes[0]]) for k in classes]) for classes in found.values()]


def _step(names: Names, layout: Layout, lookup: Lookup, part: int, seen: Sequence[Seen]) -> Row:
    """Return a lookup in the pass of a part: its inputs, how its row number is computed and in which register, what
    update() compares, and the offset of its rows.
    """
    compared = [joint for joint in reversed(lookup.joints) if joint.compared]
    trimmed = [joint for joint in lookup.joints if not joint.compared]
    weights = [joint.weight for joint in compared]
    factors = [before // weight for before, weight in pairwise(weights)]
    joints = [comment(names.joints[joint.number].name) for joint in lookup.joints]
    group = [] if lookup.group is None else group_lines(layout.fields[lookup.group])
    return {
        "index": lookup.index,
        "what": ", ".join(joints) if lookup.group is None else switches_in_words(layout.groups[lookup.group]),
        "rows": (part * layout.n_rows + lookup.first_row) * layout.parts.width * layout.entry_bits // 8,
        **_compared(seen),
        **_exchange(layout, len(layout.tables.slopes) + lookup.index),
        **({} if lookup.joints or layout.biased else {"kind": "switches"}),
        "compared": [
            {
                **_taken(layout, joint.number, seen),
                "times": times,
                "steps": (joint.thresholds.astype(int) + 1).tolist(),
            }
            for joint, times in zip(compared, [1, *factors], strict=False)
        ],
        "times": weights[-1] if weights else 1,
        "trimmed": [
            {**_taken(layout, joint.number, seen), **_bins(layout, joint), "how": how}
            for joint, how in zip(trimmed, _adding(len(trimmed), bool(compared)), strict=True)
        ],
        "group": group,
        "borrows": borrows(layout, lookup),
        "register": 30 if trimmed or group else 0,
    }


def _bins(layout: Layout, joint: JointLayout) -> Row:
    first, last = joint.first, len(joint.bins) - 1
    return {
        "bins": joint.first_bin,
        "first": first,
        "last": last,
        "lower": first > 0,
        "upper": first + last < (1 << layout.code_bits) - 1,
    }


def _adding(count: int, before: bool) -> list[str]:
    """Return the instruction that adds each of `count` numbers in r30 to a sum in r0, which may hold a number `before`;
    the last leaves the sum in r30.
    """
    found = ["add   r0, r30"] * (count - 1) + ["add   r30, r0" if count > 1 or before else ""]
    if count > 1 and not before:
        found[0] = "mov   r0, r30"
    return found if count else []
