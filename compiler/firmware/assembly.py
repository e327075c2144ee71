"""The classifier in AVR assembly: which registers hold the sums, and where each look-up finds its row."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from .errors import FirmwareError
from .layout import Layout, Lookup, lookups
from .words import Names, comment

# Free to use for a C function, and to be kept for its caller.
_FREE, _KEPT = (18, 20, 22, 24, 26), (28, 16, 14, 12, 10, 8, 6, 4, 2)
_IMMEDIATE = 16  # registers from here on can be loaded with a constant
_LPM_REACH = 65536
# rcall reaches 4 KiB either way; all that update() does about a look-up must stay within that.
_NEAR_BYTES = 3600
_LOOKUP_BYTES = 104  # of the longest kind


@dataclass(frozen=True, slots=True)
class Sum:
    """The lower register of the pair that holds a class's sum, what it starts from, and the class's name."""

    low: int
    start: int
    grasp: str

    @property
    def immediate(self) -> bool:
        """Whether constants can be loaded into the pair."""
        return self.low >= _IMMEDIATE


@dataclass(frozen=True, slots=True)
class Step:
    """One look-up: the index of its byte among those seen, its byte in the input, the offset of its rows in bytes.

    kind   "byte": the byte is the row's number; "direct", "trimmed": it is a joint's code
    bins   offset of the joint's bins; first, last: the codes that they begin with, and how many there are but one
    lower, upper, wide   whether codes lie below the bins, above them, and have 16 bits
    """

    index: int
    what: str
    group: bool
    kind: str
    source: str
    rows: int
    bins: int = 0
    first: int = 0
    last: int = 0
    lower: bool = False
    upper: bool = False
    wide: bool = False

    @property
    def coded(self) -> bool:
        """Whether what is seen of it is its code, which is compared faster than its row is found."""
        return self.kind != "byte" and not self.wide


@dataclass(frozen=True, slots=True)
class Part:
    """A pass over all look-ups for some classes: their sums, their place among the scores in bytes, its steps, and how
    many of the classes, the first ones, are in the pass before as well.
    """

    number: int
    sums: tuple[Sum, ...]
    scores: int
    again: int
    steps: tuple[Step, ...]
    last: bool


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
    return _LOOKUP_BYTES * layout.n_lookups * passes < _NEAR_BYTES


def assembly_values(name: str, names: Names, layout: Layout) -> dict[str, object]:
    """Return what the template of the assembly asks for."""
    near, parts = calls_are_near(layout), layout.parts
    registers = sorted((_FREE + _KEPT)[: parts.width])
    passes = [_part(name, names, layout, number, registers) for number in range(len(parts.firsts))]
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
        "sums": passes[0].sums,
        "stride": stride,
        "kept": [register + half for register in registers if register in _KEPT for half in (0, 1)],
        "n_seen": layout.n_lookups,
        "tables": [
            (f"thenar_{name}_rows", layout.n_rows * len(parts.firsts) * stride),
            *([(f"thenar_{name}_bins", bins)] if bins else []),
        ],
    }


def _part(name: str, names: Names, layout: Layout, number: int, registers: Iterable[int]) -> Part:
    parts = layout.parts
    first = parts.firsts[number]
    starts = layout.start[first : first + parts.width].tolist()
    grasps = map(comment, names.grasps[first : first + parts.width])
    sums = tuple(Sum(*each) for each in zip(registers, starts, grasps, strict=True))
    steps = tuple(_steps(name, names, layout, number))
    again = parts.firsts[number - 1] + parts.width - first if number else 0
    return Part(number, sums, 2 * first, again, steps, number == len(parts.firsts) - 1)


def _steps(name: str, names: Names, layout: Layout, part: int) -> Iterator[Step]:
    stride = layout.parts.width * layout.entry_bits // 8
    codes = len(layout.groups) + layout.padding
    for lookup in lookups(layout):
        rows = (part * layout.n_rows + lookup.first_row) * stride
        if lookup.joint is None:
            numbers = layout.groups[lookup.number]
            what, source = f"switches {numbers[0]} to {numbers[-1]}", f"thenar_{name}_input + {lookup.number}"
            yield Step(lookup.index, what, True, "byte", source, rows)
            continue
        what = comment(names.joints[lookup.number].name)
        if layout.bins == "search":
            source = f"thenar_{name}_found + {lookup.index - len(layout.groups)}"
            yield Step(lookup.index, what, False, "byte", source, rows)
        else:
            source = f"thenar_{name}_input + {codes + lookup.number * layout.code_bits // 8}"
            yield _binned(lookup, what, layout, source, rows)


def _binned(lookup: Lookup, what: str, layout: Layout, source: str, rows: int) -> Step:
    assert lookup.joint is not None
    first, last = lookup.joint.first, len(lookup.joint.bins) - 1
    return Step(
        lookup.index,
        what,
        False,
        layout.bins,
        source,
        rows,
        bins=lookup.first_bin,
        first=first,
        last=last,
        lower=first > 0,
        upper=first + last < (1 << layout.code_bits) - 1,
        wide=layout.code_bits == 16,
    )
