"""Cycles, flash and RAM of the classifier on an AVR, counted in its assembly as it is rendered, instruction by
instruction along the longest path.

All frames take the same time with two exceptions: each class whose score exceeds all earlier ones costs a cycle, and
so does each 16-bit code below a slope, or beyond a slope that is longer than a byte.
"""

import re
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.firmware_templates.rendering import render

from .assembly import (
    MOST_DISTANCE,
    assembly_values,
    far,
    finds_first,
    found_place,
    found_size,
    glove_size,
    kept_registers,
    last_size,
    seen_inputs,
)
from .costs import NAME_BYTES, Cost
from .layout import Field, JointLayout, Layout, Lookup
from .words import numbered

# AVR Instruction Set Manual, DS40002198, table 5-1: cores AVRe (ATmega328P) and AVRe+ (ATmega2560), whose program
# counter of three bytes makes calls and returns a cycle longer. A branch or a skip that is taken costs more.
_ONE = (
    "adc add and andi bst clr cp cpc clt cpi eor inc ldi lsl lsr mov movw neg or ori ror sbc sbci set sub subi swap tst"
)
_TWO = "adiw icall ld ldd lds mul muls pop push sbiw st std sts"
_CYCLES = dict.fromkeys(_ONE.split(), 1) | dict.fromkeys(_TWO.split(), 2) | {"lpm": 3}
_JUMPS = {"rjmp": 2, "jmp": 3}
_CALLS = {"rcall": 3, "call": 4, "ret": 4}
_SKIPS = ("cpse", "sbrc")
_TWO_WORDS = ("lds", "sts", "call", "jmp")
_COMMENT, _LOOP = re.compile(r"/\*.*?\*/", re.DOTALL), re.compile(r"/\* (\d+) times \*/")


Ways = tuple[int, int]
"""The fewest and the most cycles of all ways through some code."""


class Instruction(NamedTuple):
    """An instruction, where it may jump to or call, how often it is met if it ends a loop (0: it always jumps), its
    bytes, and its cycles; 0 where these depend on what follows.
    """

    name: str
    target: str
    times: int
    size: int
    cycles: int


class Line(NamedTuple):
    """A line of assembly: its first word, its label, "" if it has none, and its instruction if it has one."""

    first: str
    label: str
    instruction: Instruction | None


class Assembly:
    """The instructions of rendered assembly, macros expanded, preprocessed for a part with or without ELPM."""

    def __init__(self, text: str, *, elpm: bool) -> None:
        self._counter = 3 if elpm else 2
        self._code: list[Instruction] = []
        self._labels: dict[str, list[int]] = {}
        self._sections: list[str] = []
        self._found: dict[int, Ways] = {}
        self._read(text, elpm)
        if unknown := {each.name for each in self._code if each.cycles < 0}:
            raise AssertionError(f"instructions of unknown cycles: {', '.join(unknown)}")
        self._to = [-1 if each.cycles else self._at(each.target, at) for at, each in enumerate(self._code)]

    def _read(self, text: str, elpm: bool) -> None:
        macros: dict[str, list[Line]] = {}
        into: list[Line] | None = None
        using, section = True, ""
        for said in _COMMENT.sub(lambda comment: _times(comment[0]), text).splitlines():
            line = _read_line(said)
            if line.first in ("#ifdef", "#endif"):
                using = elpm or said.split()[1:] != ["__AVR_HAVE_ELPM__"]
            elif line.first == ".macro":
                into = macros[said.split()[1]] = []
            elif line.first == ".endm":
                into = None
            elif into is not None:
                into.append(line)
            elif line.first == ".section":
                section = said.split()[1].split(",")[0]
            elif using:
                self._add(_expanded(line, macros), section)

    def _add(self, lines: list["Line"], section: str) -> None:
        """Note the labels and the instructions of lines."""
        for _, label, found in lines:
            if label:
                self._labels.setdefault(label, []).append(len(self._code))
            if found:
                self._code.append(found)
                self._sections.append(section)

    def size(self, section: str = "") -> int:
        """Return the bytes of code, of one section or of all."""
        pairs = zip(self._code, self._sections, strict=True)
        return sum(each.size for each, its in pairs if section in ("", its))

    def span(self, first: str, last: str) -> int:
        """Return the bytes of code from a label to another, or to the end where that is not there."""
        end = self._labels.get(last, [len(self._code)])[0]
        return sum(each.size for each in self._code[self._labels[first][0] : end])

    def cycles(self, label: str) -> Ways:
        """Return the cycles from a label to the return from there, which is counted."""
        return self._from(self._labels[label][0])

    def _from(self, start: int) -> Ways:
        """Return the cycles from an instruction to the return."""
        if start not in self._found:
            self._found[start] = self._path(start, self._end(start) + 1)
        return self._found[start]

    def _end(self, start: int) -> int:
        """Return the first instruction that ends what begins at `start`: no branch leads across it."""
        reached = start
        for at in range(start, len(self._code)):
            name = self._code[at].name
            if name.startswith("br"):
                reached = max(reached, self._to[at])
            elif name in ("ret", "jmp", "rjmp") and at >= reached and self._code[at - 1].name != "cpse":
                return at
        raise AssertionError("assembly that does not return")

    def _at(self, target: str, at: int) -> int:
        """Return the instruction that a jump or call at `at` leads to, -1 for one outside."""
        if target[:-1].isdigit():
            places = self._labels[target[:-1]]
            return places[bisect_right(places, at) - (target[-1] == "b")]
        return self._labels[target][0] if target in self._labels else -1

    def _stops(self, at: int) -> bool:
        """Return whether an instruction leaves this assembly for good, on a path that no prediction takes."""
        return self._code[at].name in _JUMPS and self._to[at] < 0

    def _path(self, start: int, end: int) -> Ways:
        """Return the cycles of code from `start` on until it comes to `end` or returns."""
        left = {end: (0, 0), end + 1: (0, 0)}  # cycles from an instruction on
        for at in range(end - 1, start - 1, -1):
            cycles = self._code[at].cycles
            least, most = left[at + 1]
            left[at] = (least + cycles, most + cycles) if cycles else self._ways(at, left)
        return left[start]

    def _ways(self, at: int, left: dict[int, Ways]) -> Ways:
        """Return the cycles from an instruction on that may be followed by another than the next one."""
        each, to, after = self._code[at], self._to[at], left[at + 1]
        if each.name in _CALLS:
            called = _CALLS[each.name] + self._counter - 2
            return (called, called) if each.name == "ret" else _more(called, _both(after, self._from(to)))
        if each.name in _JUMPS:
            return _more(_JUMPS[each.name], self._from(to) if to >= 0 else (0, 0))
        if each.name in _SKIPS:
            skipped = _more(1 + self._code[at + 1].size // 2, left[at + 2])
            return skipped if self._stops(at + 1) else _either(_more(1, after), skipped)
        if not each.times:  # something is missing: what that takes is not counted
            return _more(2, left[to])
        if to > at:
            return _either(_more(1, after), _more(2, left[to]))
        least, most = _more(2, self._path(to, at))
        return _more(1, _both(after, ((each.times - 1) * least, (each.times - 1) * most)))


def _more(cycles: int, ways: Ways) -> Ways:
    return cycles + ways[0], cycles + ways[1]


def _both(one: Ways, other: Ways) -> Ways:
    return one[0] + other[0], one[1] + other[1]


def _either(one: Ways, other: Ways) -> Ways:
    return min(one[0], other[0]), max(one[1], other[1])


def _expanded(line: Line, macros: Mapping[str, list[Line]]) -> list[Line]:
    """Return the line, or those of the macro that it calls."""
    return (
        [each for inner in macros[line.first] for each in _expanded(inner, macros)] if line.first in macros else [line]
    )


@lru_cache(maxsize=4096)
def _read_line(line: str) -> Line:
    label, _, text = line.rpartition(":")
    said, _, times = text.partition("\0")
    name, *operands = said.split(maxsplit=1) or ["."]
    first, label = (line.split() or [""])[0], label.strip()
    if name[0] in ".#":
        return Line(first, label, None)
    size = 4 if name in _TWO_WORDS else 2
    depends = name in _JUMPS or name in _CALLS or name in _SKIPS or name.startswith("br")
    cycles = 0 if depends else _CYCLES.get(name, -1)  # -1: no instruction, a macro perhaps
    target = operands[0].strip() if operands else ""
    return Line(first, label, Instruction(name, target, int(times or 1), size, cycles))


def _times(comment: str) -> str:
    said = _LOOP.fullmatch(comment)
    return f"\0{said[1]}" if said else ""


_LARGE = 5  # numbers from here on are multiplied by `mul`
# Bytes of C code, rounded up; a table of whole pages of bins begins at one.
_SET_SWITCH, _GRASP, _INIT, _PAGE = 80, 40, 70, 256
_LOSING, _LOSING_JOINTS = 400, 300
# Bytes of variables: what is done while an input is missing, the glove where rows are found first, rows in update().
_POINTER = 2
# Return addresses of update(), of what it calls about a change, and of what adds a row; a row's number is on top.
_CALLS_DEEP = 3
_RCALL_REACH = 4094  # bytes, forwards and backwards
_ELPM_BYTES = 16  # where a part has ELPM, classify() looks where its tables end


Frame = tuple[NDArray[np.bool_], NDArray[np.uint16]]

_DRAWN, _CLIMBED, _ROUNDS, _BETWEEN = 4096, 8, 20, 33


class Counts(NamedTuple):
    """The fewest cycles of classify, the most of it and of update; bytes of all code, of what is not needed to
    classify, and of what calls in update() must reach across.
    """

    least: int
    classify: int
    update: int
    size: int
    uncalled: int
    across: int

    def plus(self, more: "Counts", times: int = 1) -> "Counts":
        """Return the sum of these and of `times` more."""
        return Counts(*(one + times * other for one, other in zip(self, more, strict=True)))


@dataclass(frozen=True, slots=True)
class _Part:
    """Lookups of a layout; two are equal if they need the same code."""

    key: tuple[object, ...]
    layout: Layout = field(compare=False)
    lookups: tuple[Lookup, ...] = field(compare=False)


def _of_joint(layout: Layout, joint: JointLayout) -> tuple[int, ...]:
    """Return a joint's part in the code that finds a row: its steps, and its factor or clamps."""
    place, wide = len(layout.ports) + layout.padding + joint.number * layout.code_bits // 8, layout.code_bits == 16
    beyond = far(place, wide=wide)
    if joint.compared:
        return beyond, len(joint.thresholds), min(joint.weight, _LARGE)
    if layout.bins == "direct":
        return (beyond,)
    return beyond, -1, joint.first > 0, joint.first + len(joint.bins) < 1 << layout.code_bits


def _of_group(layout: Layout, lookup: Lookup) -> tuple[Field, ...]:
    """Return a group's part in the code that assembles its index, independent of its ports."""
    return () if lookup.group is None else _anywhere(layout.fields[lookup.group])


@lru_cache(maxsize=512)
def _anywhere(fields: tuple[Field, ...]) -> tuple[Field, ...]:
    return tuple(replace(field, port=far(field.port)) for field in fields)


@lru_cache(maxsize=4096)
def _counted(part: _Part, near: bool, elpm: bool) -> Counts:
    """Return the counts of the assembly of a layout with only these lookups."""
    layout = replace(part.layout, lookups=part.lookups)
    values = assembly_values("x", numbered(layout.tables), layout, near=near, whole=part.layout)
    common = {"name": "x", "opening": "", "biased": layout.biased, "width": layout.parts.width}
    common |= {"classes": layout.tables.n_classes, "n_rows": layout.n_rows, "relative": layout.tables.relative}
    common |= {"n_lookups": len(layout.lookups), "n_slopes": len(layout.tables.slopes)}
    found = Assembly(render("classifier/thenar_NAME_avr.S.j2", **common, assembly=values), elpm=elpm)
    _, update = found.cycles("thenar_x_update")
    uncalled = found.size(".text.thenar_x_update") + found.size(".text.thenar_x_start_without")
    across = found.span("thenar_x_update", "thenar_x_update_near")
    return Counts(*found.cycles("thenar_x_classify"), update, found.size(), uncalled, across)


def _total(layout: Layout, near: bool, elpm: bool) -> Counts:
    """Return the counts of the assembly of a layout.

    Lookups follow one another, so the contribution of each is counted once for all layouts: its assembly alone, less
    what is left of that without it, which is what it takes alone less than twice.
    """
    compares = layout.code_bits == 16 and layout.bins == "search"
    kind = layout.entry_bits, layout.sum_bits, layout.entry_shift, layout.code_bits, compares, layout.adding
    of_all = (layout.tables.n_classes, layout.tables.relative, layout.tables.slopes, *kind)
    seen, slopes = seen_inputs(layout), len(layout.tables.slopes)

    def count(*lookups: Lookup) -> Counts:
        shapes = tuple(
            (
                _of_group(layout, lookup),
                tuple([far(each.before, wide=each.size > 1) for each in seen.get(slopes + lookup.index, ())]),
                far(found_place(layout, slopes + lookup.index)),
                tuple([_of_joint(layout, joint) for joint in lookup.joints]),
            )
            for lookup in lookups
        )
        return _counted(_Part((shapes, of_all), layout, lookups), near, elpm)

    def around(lookup: Lookup) -> Counts:
        return count(lookup).plus(count(lookup)).plus(count(lookup, lookup), -1)

    if layout.tables.slopes:
        return count(*layout.lookups)  # which take longer to render than many lookups
    first = {bool(lookup.joints): lookup for lookup in reversed(layout.lookups)}
    between = {joints: around(lookup) for joints, lookup in first.items()}
    counts = count(*first.values())
    for lookup in layout.lookups:
        if lookup is not first[bool(lookup.joints)]:
            counts = counts.plus(count(lookup)).plus(between[bool(lookup.joints)], -1)
    return counts


def calls_are_near(layout: Layout) -> bool:
    """Return whether all calls are `rcall`; else they are `call`, a word and a cycle more."""
    counts = _total(layout, near=True, elpm=False)
    classify = 0 if layout.adding == "unrolled" else counts.size - counts.uncalled + _ELPM_BYTES
    return max(counts.across, classify) <= _RCALL_REACH


class AvrCosts:
    """The costs of a layout on an AVR; its flash, in bytes, determines the width of its program counter."""

    def __init__(self, layout: Layout, flash: int) -> None:
        self._layout, self._counter = layout, 3 if flash > 128 << 10 else 2
        self._counts = _total(layout, calls_are_near(layout), self._counter == 3)

    @property
    def cost(self) -> Cost:
        """What the classifier takes at most, a few bytes more of flash and RAM."""
        names = NAME_BYTES * (self._layout.tables.n_classes + 1)
        flash, counts = self.flash + names, self._counts
        return Cost(counts.classify, counts.update, flash, flash - counts.uncalled - self.losing, self.ram)

    @property
    def fixed_cycles(self) -> int:
        """Cycles of classify that every frame takes."""
        return self._counts.least

    @property
    def flash(self) -> int:
        """Bytes of tables and code, at most; the names of the grasp types come on top."""
        layout, parts = self._layout, self._layout.parts
        tables = layout.n_rows * len(parts.firsts) * parts.width * layout.entry_bits // 8
        tables += 2 * layout.tables.n_switches * (2 if len(layout.ports) > 255 else 1)
        tables += 2 * layout.tables.n_classes  # what scores begin with
        bins = sum(len(joint.bins) for joint in layout.joints)
        tables += bins + (_PAGE - 1 if layout.bins == "direct" and bins else 0)
        return tables + self.losing + self._counts.size + _INIT + _GRASP + (_SET_SWITCH if layout.groups else 0)

    @property
    def ram(self) -> int:
        """Bytes of a glove, of variables and of the deepest stack, return address included."""
        layout = self._layout
        stack = len(kept_registers(layout)) + _CALLS_DEEP * self._counter + 1
        variables = _POINTER * (1 + finds_first(layout) + (layout.n_rows > 0)) + found_size(layout) + last_size(layout)
        return glove_size(layout) + variables + stack

    @property
    def losing(self) -> int:
        """Bytes of flash, at most and without the assembly, of what replaces missing inputs by their means."""
        means = self._layout.means.size * (1 if self._layout.narrow_means else 2)
        return means + (_LOSING if self._layout.groups else _LOSING_JOINTS)


def rises(layout: Layout, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int64]:
    """Return how many classes of each frame, bits (n, s) and codes (n, j), are better than all before them, (n,), and
    how many codes of 16 bits are cut off at an end of their slope where that takes longer: the cycles that classify
    takes beyond the fixed ones.
    """
    scores = layout.scores(bits, codes)
    if len(layout.parts.firsts) == 1:
        scores = scores[:, : layout.parts.width]  # a last class to which the others are relative takes none
    best = np.maximum.accumulate(scores, axis=1)
    cycles: NDArray[np.int64] = np.count_nonzero(scores[:, 1:] > best[:, :-1], axis=1)
    for slope in layout.tables.slopes if layout.code_bits == 16 else ():
        code = codes[:, slope.joint]
        cycles = cycles + ((code < slope.low) | ((code >= slope.high) & (slope.high - slope.low > MOST_DISTANCE)))
    return cycles


def worst_frame(layout: Layout) -> Frame:
    """Return bits (s,) and codes (j,) of a frame than which none was found to take longer on an AVR; the same one every
    time.

    The worst frame is the one with the most classes that are better than all before them, alike on all parts. It is
    sought by a climb from random frames, one input at a time, and proved the worst where it reaches the bound.
    """
    random = np.random.default_rng(0)
    choices = [_codes(layout, number) for number in range(layout.tables.n_joints)]
    bits = random.random((_DRAWN, layout.tables.n_switches)) < 0.5
    codes = np.empty((_DRAWN, len(choices)), np.uint16)
    for column, some in zip(codes.T, choices, strict=True):
        column[:] = random.choice(some, _DRAWN)
    order = np.argsort(-rises(layout, bits, codes), kind="stable")[:_CLIMBED]
    climbed = [_climb(layout, (bits[row], codes[row]), choices) for row in order]
    return max(climbed, key=lambda frame: _cycles(layout, frame))


def _codes(layout: Layout, number: int) -> NDArray[np.uint16]:
    """Return codes of a joint that differ in row or time: the least of each bin and, below all bins, zero."""
    steps, slope = layout.tables.steps_of(number) + 1, layout.tables.slope_of(number)
    if slope is not None:
        between = np.linspace(slope.low, slope.high, _BETWEEN).astype(np.int64)
        steps = np.unique(np.concatenate([steps, between, [slope.low + 1, slope.high - 1]]))
    return np.concatenate([[0], steps[steps < 1 << layout.code_bits]]).astype(np.uint16)


def _climb(layout: Layout, frame: Frame, choices: list[NDArray[np.uint16]]) -> Frame:
    """Climb from a frame: repeatedly take the best of the frames that differ in one input."""
    for _ in range(_ROUNDS):
        bits, codes = _neighbours(frame, choices)
        cycles = rises(layout, bits, codes)
        best = int(cycles.argmax())
        if cycles[best] <= cycles[0]:
            break
        frame = bits[best], codes[best]
    return frame


def _neighbours(frame: Frame, choices: list[NDArray[np.uint16]]) -> tuple[NDArray[np.bool_], NDArray[np.uint16]]:
    """Return the frame itself, then all that differ from it in one input: bits (n, s) and codes (n, j)."""
    bits, codes = frame
    n = 1 + len(bits) + sum(map(len, choices))
    all_bits, all_codes = np.tile(bits, (n, 1)), np.tile(codes, (n, 1))
    flipped = np.arange(len(bits))
    all_bits[1 + flipped, flipped] ^= True
    at = 1 + len(bits)
    for joint, some in enumerate(choices):
        all_codes[at : at + len(some), joint] = some
        at += len(some)
    return all_bits, all_codes


def _cycles(layout: Layout, frame: Frame) -> int:
    bits, codes = frame
    return int(rises(layout, bits[np.newaxis], codes[np.newaxis])[0])
