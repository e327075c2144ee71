"""The classifier in AVR assembly: which registers hold the sums, and where each look-up finds its row."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise, product

from . import FirmwareError
from .layout import Field, JointLayout, Layout, Lookup
from .words import Names, comment, switches_in_words

# Free to use for a C function, and to be kept for its caller; of pairs the lower.
_FREE, _KEPT = (18, 20, 22, 24, 26), (28, 16, 14, 12, 10, 8, 6, 4, 2)
_IMMEDIATE = 16  # registers from here on can be loaded with a constant
_LPM_REACH = 65536
# rcall reaches 4 KiB either way; all that update() does about a look-up must stay within that.
_NEAR_BYTES = 3600
_LOOKUP_BYTES, _JOINT_BYTES = 104, 54  # without comparisons
_SLOPE_BYTES = 80  # but for its products, which no near call reaches across


Row = dict[str, object]  # of the template's lists


def check_size(layout: Layout) -> None:
    """Raise FirmwareError if the tables alone are more than an AVR's lpm can reach."""
    parts = layout.parts
    entries = layout.n_rows * parts.width * len(parts.firsts)
    needed = entries * layout.entry_bits // 8 + sum(len(joint.bins) for joint in layout.joints)
    if needed > _LPM_REACH:
        raise FirmwareError(f"the tables need {needed} bytes, an AVR reads constants from the first {_LPM_REACH} bytes")


def assembly_values(name: str, names: Names, layout: Layout, *, near: bool) -> dict[str, object]:
    """Return what the template of the assembly asks for; `near` is what `calls_are_near` says of the whole layout."""
    parts = layout.parts
    stride = parts.width * layout.entry_bits // 8
    steps = _Steps(name, names, layout)
    passes = [_pass(names, layout, number, steps) for number in range(len(parts.firsts))]
    bins = sum(len(joint.bins) for joint in layout.joints)
    return {
        "byte_sums": layout.sum_bits == 8,
        "wide": layout.code_bits == 16,
        "prepared": prepared(layout),
        "unrolled": layout.adding == "unrolled",
        "call": "rcall" if near else "call",
        "jump": "rjmp" if near else "jmp",
        "passes": passes,
        "finds": [steps.finding(lookup) for lookup in layout.lookups if lookup.joints],
        "sums": passes[0]["sums"],
        "stride": stride,
        "kept": kept_registers(layout),
        "zero_rows": [lookup.zero_row for lookup in layout.lookups],
        "n_sources": len(inputs_seen(layout)),
        "n_seen_slopes": len(layout.tables.slopes),
        "halves": layout.entry_shift == 8,
        "clean": layout.biased and not layout.entry_shift,  # r1 is zero between look-ups
        "n_found": sum(bool(lookup.joints) for lookup in layout.lookups),
        "tables": [
            *([(f"thenar_{name}_rows", layout.n_rows * len(parts.firsts) * stride)] if layout.n_rows else []),
            *([(f"thenar_{name}_bins", bins)] if bins else []),
        ],
    }


def prepared(layout: Layout) -> bool:
    """Return whether joints' rows are found before any sum takes a register: where codes have 16 bits, which take more
    of them, and once for all passes.
    """
    return bool(layout.joints) and (layout.code_bits == 16 or len(layout.parts.firsts) > 1)


def calls_are_near(layout: Layout) -> bool:
    """Return whether all calls are `rcall`; else they are `call`, a word and a cycle more."""
    joints = sum(_JOINT_BYTES + 4 * len(joint.thresholds) * joint.compared for joint in layout.joints)
    passes = len(layout.parts.firsts)
    wide = sum(4 * len(joint.thresholds) * joint.compared for joint in layout.joints) * (layout.code_bits == 16)
    groups = [layout.fields[lookup.group] for lookup in layout.lookups if lookup.group is not None]
    put_together = 2 * sum(len(group_lines(fields, [""] * len(fields), [""] * len(fields))) for fields in groups)
    put_together += sum(4 * len(fields) for fields in groups)
    each = put_together + _LOOKUP_BYTES * len(layout.lookups) + _SLOPE_BYTES * len(layout.tables.slopes)
    return each * passes + joints + wide < _NEAR_BYTES


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


def group_lines(fields: Sequence[Field], inputs: Sequence[str], seen: Sequence[str | None]) -> list[str]:
    """Return the instructions that make the byte of a group of its fields' ports, at `inputs`, in r30; r31 is theirs to
    use, r0 and r1 are not. What is read is kept where `seen` says.
    """
    lines: list[str] = []
    for field, source, kept in zip(fields, inputs, seen, strict=True):
        register = "r31" if lines else "r30"
        lines.append(f"lds   {register}, {source}")
        if kept is not None:
            lines.append(f"sts   {kept}, {register}")
        moved = [line.format(register) for line in _moved(field.bit, field.width, field.to)]
        if register == "r31" and 2 * field.width <= len(moved) + 1:
            for bit in range(field.width):
                lines += [f"sbrc  r31, {field.bit + bit}", f"ori   r30, {1 << (field.to + bit):#04x}"]
        else:
            lines += [*moved, *(["or    r30, r31"] if register == "r31" else [])]
    return lines


def _registers(layout: Layout) -> list[int]:
    """Return the registers of the sums of a pass; of pairs the lower."""
    pairs = [*_FREE, *_KEPT]
    found = pairs if layout.sum_bits == 16 else [low + half for low in pairs for half in (0, 1)]
    return sorted(found[: layout.parts.width])


def kept_registers(layout: Layout) -> list[int]:
    """Return the registers that are saved because they hold sums."""
    halves = (0, 1) if layout.sum_bits == 16 else (0,)
    return [low + half for low in _registers(layout) for half in halves if low // 2 * 2 in _KEPT]


def inputs_seen(layout: Layout) -> list[tuple[int, int]]:
    """Return the bytes of the frame of which update() keeps what they were, of inputs that make rows' numbers: for each
    the look-up and the byte.
    """
    return [
        (lookup.index, place)
        for lookup in layout.lookups
        if lookup.joints and not prepared(layout)
        for place in _places(lookup, layout)
    ]


def _pass(names: Names, layout: Layout, number: int, steps: "_Steps") -> Row:
    """Return a pass over all look-ups for some classes: their sums, each in a register or in a pair from `low` on,
    their place among the scores in bytes, and how many of them, the first ones, are in the pass before as well.
    """
    parts = layout.parts
    first = parts.firsts[number]
    starts = layout.start[first : first + parts.width].tolist()
    grasps = map(comment, names.grasps[first : first + parts.width])
    high = int(layout.sum_bits == 16)
    return {
        "number": number,
        "sums": [
            {"low": low, "high": low + high, "start": start, "grasp": grasp, "immediate": low >= _IMMEDIATE}
            for low, start, grasp in zip(_registers(layout), starts, grasps, strict=True)
        ],
        "scores": 2 * first,
        "again": parts.firsts[number - 1] + parts.width - first if number else 0,
        "steps": [steps.step(lookup, number) for lookup in layout.lookups],
        "slopes": [_slope(steps.name, names, layout, at, first) for at in range(len(layout.tables.slopes))],
        "last": number == len(parts.firsts) - 1,
    }


def _slope(name: str, names: Names, layout: Layout, at: int, first: int) -> Row:
    """Return a slope: its code in the input, how that is held within its range and scaled, and what it multiplies:
    entries, each with the sums that it is added to, or subtracted from.
    """
    slope, bits, registers = layout.tables.slopes[at], layout.code_bits, _registers(layout)
    place = len(layout.ports) + layout.padding + slope.joint * bits // 8
    index = len(layout.lookups) + len(inputs_seen(layout)) + at
    return {
        "index": index,
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


class _Steps:
    """Steps of the template, one a look-up: what it is of, where its inputs are and where update() finds what they
    were, how the row's number is made of them, and which register has it then.
    """

    def __init__(self, name: str, names: Names, layout: Layout) -> None:
        self.name, self.names, self._layout = name, names, layout
        indexed = [lookup.index for lookup in layout.lookups if lookup.joints and prepared(layout)]
        self._found = {index: f"thenar_{name}_found + {at}" for at, index in enumerate(indexed)}
        places = enumerate(inputs_seen(layout), len(layout.lookups))
        self._seen = {place: f"thenar_{name}_seen + {at}" for at, place in places}

    def step(self, lookup: Lookup, part: int) -> Row:
        """Return a look-up in a pass for the classes of a part."""
        layout = self._layout
        row = part * layout.n_rows + lookup.first_row
        seen = f"thenar_{self.name}_seen + {lookup.index}"
        step: Row = {
            "index": lookup.index,
            "what": self._what(lookup),
            "seen": seen,
            "rows": row * layout.parts.width * layout.entry_bits // 8,
            "one_group": not lookup.joints,
            "inline": lookup.index not in self._found and bool(lookup.joints),
            "register": 30,
        }
        if step["inline"]:
            return step | self.finding(lookup)
        if lookup.group is None or lookup.joints:
            lines = [f"lds   r30, {self._found[lookup.index]}"]
        else:
            fields = layout.fields[lookup.group]
            lines = group_lines(fields, [self._input(field.port) for field in fields], [None] * len(fields))
        return {**step, "lines": lines}

    def finding(self, lookup: Lookup) -> Row:
        """Return how the number of a row is made of codes."""
        sources = [self._source(lookup, place) for place in _places(lookup, self._layout)]
        of_joint = dict(zip((joint.number for joint in lookup.joints), sources, strict=False))
        compared = [joint for joint in reversed(lookup.joints) if joint.compared]
        trimmed = [joint for joint in lookup.joints if not joint.compared]
        grouped = lookup.group is not None
        weights = [joint.weight for joint in compared]
        factors = [before // weight for before, weight in pairwise(weights)]
        return {
            "what": self._what(lookup),
            "sources": sources,
            "compared": [
                {**of_joint[joint.number], "times": times, "steps": (joint.thresholds.astype(int) + 1).tolist()}
                for joint, times in zip(compared, [1, *factors], strict=False)
            ],
            "times": weights[-1] if weights else 1,
            "trimmed": [
                {**of_joint[joint.number], **self._bins(joint), "how": how}
                for joint, how in zip(trimmed, _adding(len(trimmed), bool(compared), grouped), strict=True)
            ],
            "group": self._put_together(lookup, sources) if grouped else [],
            "register": 30 if trimmed or grouped else 0,
            "found": self._found.get(lookup.index),
        }

    def _what(self, lookup: Lookup) -> str:
        groups = [self._layout.groups[lookup.group]] if lookup.group is not None else []
        joints = [comment(self.names.joints[joint.number].name) for joint in lookup.joints]
        return ", ".join([*map(switches_in_words, groups), *joints])

    def _input(self, place: int) -> str:
        return f"thenar_{self.name}_input + {place}"

    def _source(self, lookup: Lookup, place: int) -> Row:
        wide = self._layout.code_bits == 16 and place >= len(self._layout.ports)
        return {"input": self._input(place), "seen": self._seen.get((lookup.index, place)), "wide": wide}

    def _put_together(self, lookup: Lookup, sources: Sequence[Row]) -> list[str]:
        fields = self._layout.fields[lookup.group or 0]
        ports = sources[-len(fields) :]
        seen = [None if port["seen"] is None else str(port["seen"]) for port in ports]
        return group_lines(fields, [str(port["input"]) for port in ports], seen)

    def _bins(self, joint: JointLayout) -> Row:
        first, last = joint.first, len(joint.bins) - 1
        above = first + last < (1 << self._layout.code_bits) - 1
        paged = self._layout.bins == "direct"
        return {
            "bins": joint.first_bin,
            "first": first,
            "last": last,
            "lower": first > 0,
            "upper": above,
            "paged": paged,
        }


def _places(lookup: Lookup, layout: Layout) -> list[int]:
    """Return the bytes of the frame at which the inputs of a look-up begin, its joints first."""
    codes = len(layout.ports) + layout.padding
    places = [codes + joint.number * layout.code_bits // 8 for joint in lookup.joints]
    return places + ([] if lookup.group is None else [field.port for field in layout.fields[lookup.group]])


def _adding(count: int, before: bool, after: bool) -> list[str]:
    """Return what is done with each of `count` numbers in r30, that are added up in r0 and in the end in r30; whether
    there is one in r0 before, and whether one comes after.
    """
    last = [] if after else ["add   r30, r0" if count > 1 or before else ""]
    rest = ["add   r0, r30"] * (count - len(last) if count else 0)
    if rest and not before:
        rest[0] = "mov   r0, r30"
    return [*rest, *last][:count]
