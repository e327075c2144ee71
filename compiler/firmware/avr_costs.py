"""Cycles, flash and RAM of the classifier on an AVR, counted from the instructions of its template.

Every piece below is what firmware_templates/classifier/thenar_NAME_avr.S.j2 says in that place, mnemonic by mnemonic.
All frames take the same way through it but for three things: each class that is better than all before it costs a
cycle, a code of 16 bits below a joint's bins another, and a search for a code's row depends on the code. The search is
C: its cycles are those of avr-gcc 5.4 with -Os.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from .assembly import calls_are_near, group_lines
from .costs import NAME_BYTES, Cost
from .layout import JointLayout, Layout

# AVR Instruction Set Manual, DS40002198, table 5-1: cores AVRe (ATmega328P) and AVRe+ (ATmega2560), whose program
# counter of three bytes makes calls and returns a cycle longer. A conditional branch is one that is not taken.
_ONE = (
    "adc add and andi brcc breq brge brlo brne clr cp cpc cpi cpse eor ldi lsl lsr mov movw or ori sbc sbci sbrc sub "
    "subi swap tst"
)
_TWO = "icall ld lds mul pop push rjmp st sts taken"
_CYCLES = dict.fromkeys(_ONE.split(), 1) | dict.fromkeys(_TWO.split(), 2) | {"lpm": 3, "jmp": 3, "skip": 3}
_CALLS = {"rcall": 3, "call": 4, "ret": 4}
_WORDS = {"lds": 2, "sts": 2, "call": 2, "jmp": 2, "taken": 0, "skip": 0}


@dataclass(frozen=True, slots=True)
class Code:
    """Instructions in sequence: how often a call or return is among them, the cycles of all others, and their bytes."""

    cycles: int = 0
    calls: int = 0
    size: int = 0

    def __add__(self, other: Self) -> "Code":
        return Code(self.cycles + other.cycles, self.calls + other.calls, self.size + other.size)

    def __mul__(self, times: int) -> "Code":
        return Code(times * self.cycles, times * self.calls, times * self.size)

    def takes(self, counter_bytes: int) -> int:
        """Return the cycles where the program counter has that many bytes, 2 or 3."""
        return self.cycles + self.calls * (counter_bytes - 2)


@cache
def code(text: str) -> Code:
    """Return the instructions whose mnemonics `text` holds; "taken" is a branch that is, "skip" one over a `jmp`, each
    of which takes no room, standing for what is in the text of the other path.
    """
    words = text.split()
    return Code(
        cycles=sum(_CALLS[word] if word in _CALLS else _CYCLES[word] for word in words),
        calls=sum(word in _CALLS for word in words),
        size=2 * sum(_WORDS.get(word, 1) for word in words),
    )


def together(pieces: Iterable[Code]) -> Code:
    """Return all pieces in sequence."""
    return sum(pieces, Code())


# The search for a code's row, as avr-gcc 5.4 makes it of find() and below(). Another compiler may make something else
# of it: where cycles matter, there are layouts without a search.
# classify() calls find() and jumps on; find() saves four registers, and calls below() for each joint.
_CLASSIFY, _FIND = code("call jmp"), code("push push push push ldi ldi ldi ldi pop pop pop pop ret")
_JOINT = {8: code("movw ld ldi ldi ldi call st"), 16: code("movw ld ld ldi ldi ldi call st")}
_BELOW = {
    8: code("movw ldi movw add adc and taken ret"),
    16: code("push push movw ldi movw add adc and taken pop pop ret"),
}
_STEP = {
    8: code("and breq mov mov movw add adc subi sbci lpm cp").cycles,
    16: code("and breq mov mov movw add adc add adc subi sbci lpm lpm cp cpc").cycles,
}
_RIGHT, _LEFT = code("brcc ldi add add subi sub rjmp movw add adc").cycles, code("taken mov rjmp").cycles
_BYTES, _BYTES_EACH = 160, 20  # of code, rounded up


class BinSearch:
    """The search in the thresholds of `joints`, for codes of 8 or 16 bits on an AVR of `counter_bytes`, 2 or 3, in its
    program counter.
    """

    __slots__ = ("_code_bits", "_counter", "_joints")

    def __init__(self, joints: Sequence[JointLayout], code_bits: int, counter_bytes: int) -> None:
        self._joints, self._code_bits, self._counter = joints, code_bits, counter_bytes

    @property
    def fixed_cycles(self) -> int:
        """Cycles of finding all rows, without the steps of the searches."""
        each = _JOINT[self._code_bits] + _BELOW[self._code_bits]
        return (_CLASSIFY + _FIND + each * len(self._joints)).takes(self._counter)

    @property
    def most_cycles(self) -> int:
        """The most cycles of all steps of all searches."""
        return sum(int(_steps(len(joint.thresholds), self._code_bits).max()) for joint in self._joints)

    def cycles(self, joint: JointLayout, codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return the cycles of the steps for each of the joint's codes (n,)."""
        return _steps(len(joint.thresholds), self._code_bits)[joint.bin_of(codes)]

    @property
    def flash(self) -> int:
        """Bytes of thresholds and code, at most."""
        thresholds = sum(len(joint.thresholds) for joint in self._joints)
        return thresholds * self._code_bits // 8 + _BYTES + _BYTES_EACH * len(self._joints)

    @property
    def stack(self) -> int:
        """Bytes of stack: the return addresses of classify(), find() and below(), and the registers that they save."""
        return 3 * self._counter + 4 + (2 if self._code_bits == 16 else 0)


@lru_cache(maxsize=1024)
def _steps(n_thresholds: int, code_bits: int) -> NDArray[np.int64]:
    """Return the cycles of all steps for a code above 0, 1, ... n of the thresholds: (n + 1,)."""
    cycles = np.zeros(n_thresholds + 1, np.int64)
    for below in range(n_thresholds + 1):
        found, count = 0, n_thresholds
        while count:
            half = count // 2
            right = found + half < below
            cycles[below] += _STEP[code_bits] + (_RIGHT if right else _LEFT)
            found, count = (found + half + 1, count - half - 1) if right else (found, half)
    return cycles


# Pairs of registers that a function need not keep, and those that can be loaded with a constant; as in assembly.py.
_FREE_PAIRS, _IMMEDIATE_PAIRS = 5, 7

# Bytes of C code, rounded up; a table of bins begins at a page, and the compiler fills up its last one.
_SET_SWITCH, _GRASP, _PAGE = 80, 40, 256


# Seeing that no input is missing, in classify() and in update(), with the bytes of what is done otherwise.
_NOTHING_MISSING = replace(code("lds tst taken"), size=code("lds tst breq ldi ldi lds lds icall rjmp").size)
_NOTHING_TO_LEAVE = replace(_NOTHING_MISSING, size=_NOTHING_MISSING.size - code("rjmp").size)
# Bytes of C code about missing inputs, rounded up.
_LOSING, _LOSING_JOINTS = 400, 300
_LOST_RAM = 5  # how many, whether any, and what is done then

# What a code of 16 bits below a joint's bins takes more than others.
_CLAMPED = Code(1)


Frame = tuple[NDArray[np.bool_], NDArray[np.uint16]]

_DRAWN, _CLIMBED, _ROUNDS = 4096, 8, 20


class AvrCosts:
    """The costs of a layout on an AVR of so many bytes of flash, of which depends how wide its program counter is."""

    __slots__ = ("_counter", "_groups", "_layout", "_parts", "_search", "_steps", "_width")

    def __init__(self, layout: Layout, flash: int) -> None:
        parts = layout.parts
        self._layout, self._parts, self._width = layout, len(parts.firsts), parts.width
        self._counter = 3 if flash > 128 << 10 else 2
        joints = [joint for joint in layout.joints if not joint.constant]
        searched = layout.bins == "search" and joints
        self._search = BinSearch(joints, layout.code_bits, self._counter) if searched else None
        lines = (group_lines("", fields) for fields in layout.fields)
        self._groups = [code(" ".join(line.split()[0] for line in each)) for each in lines]
        self._steps = self._groups + [self._row_number(joint) for joint in joints]

    @property
    def cost(self) -> Cost:
        """What the classifier takes at most, a few bytes more of flash and RAM."""
        names = NAME_BYTES * (self._layout.tables.n_classes + 1)
        flash = self.flash + names
        uncalled = self._update.size + self._losing  # in sections of their own
        return Cost(self.most_cycles, self.most_update_cycles, flash, flash - uncalled, self.ram)

    @property
    def fixed_cycles(self) -> int:
        """Cycles of classify that every frame takes."""
        adding = self._adding + (self._call if self._layout.adding == "called" else Code())
        taken = self._guard("ldi skip") + self._classify + adding * (len(self._steps) * self._parts)
        searching = self._search.fixed_cycles if self._search else 0
        return (taken + self._answering).takes(self._counter) + searching

    @property
    def _answering(self) -> Code:
        """Finding the best class where every score is the best so far but for one cycle more each, and returning."""
        classes = self._layout.tables.n_classes
        ends = code("ret") + (code("movw ldi mov") if self._parts == 1 else code("ldi ldi ld ld ldi ldi ldi ldi brne"))
        one = "cp cpc taken" if self._parts == 1 else "ld ld cp cpc taken subi sbci cpi ldi cpc taken"
        last = Code() if self._parts == 1 else code("taken") * -1
        return ends + code(one) * (classes - 1) + last

    @property
    def most_cycles(self) -> int:
        """The most cycles that classify can take: every class better than the one before, every search the longest."""
        return self.fixed_cycles + self._most_varying

    @property
    def _most_varying(self) -> int:
        clamped = sum(self._clamps(joint) for joint in self._layout.joints) * self._parts
        searching = self._search.most_cycles if self._search else 0
        return self._layout.tables.n_classes - 1 + clamped + searching

    @property
    def most_update_cycles(self) -> int:
        """The most cycles that update can take: every look-up changed, of a group switches both opened and closed, and
        else as in `most_cycles`.
        """
        move = code("ldi ldi") * 2 + code("ld ld st st") * self._width
        compared = together(self._groups if self._coded else self._steps)
        steps = compared + (code("lds lds cpse") + self._call) * len(self._steps)
        passes = (move + steps + together(self._changing())) * self._parts
        stored_twice = self._width * self._parts - self._layout.tables.n_classes  # in classify alone
        once = _NOTHING_TO_LEAVE + code("push pop") * self._kept + code("sts") * len(self._steps)
        once += code("jmp clr") + self._answering
        searching = self._search.fixed_cycles if self._search else 0
        whole = passes + once + code("st st") * -stored_twice
        return whole.takes(self._counter) + self._most_varying + searching

    def varying_cycles(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return how many cycles more than the fixed ones classify takes for frames bits (n, s), codes (n, j): (n,)."""
        scores = self._layout.scores(bits, codes)
        best = np.maximum.accumulate(scores, axis=1)
        cycles: NDArray[np.int64] = np.count_nonzero(scores[:, 1:] > best[:, :-1], axis=1)
        for joint, column in zip(self._layout.joints, codes.T, strict=True):
            if self._clamps(joint):
                cycles = cycles + self._parts * (column < joint.first)
            if self._search and not joint.constant:
                cycles = cycles + self._search.cycles(joint, column)
        return cycles

    @property
    def flash(self) -> int:
        """Bytes of tables and code, at most; the names of the grasp types come on top."""
        layout = self._layout
        tables = layout.n_rows * self._parts * self._width * layout.entry_bits // 8 + 2 * layout.tables.n_switches
        bins = sum(len(joint.bins) for joint in layout.joints if not joint.constant)
        tables += 2 * layout.tables.n_classes  # the scores that it begins with
        tables += bins + (2 * (_PAGE - 1) if layout.bins == "direct" and bins else 0)
        if len(layout.ports) > 255:
            tables += 2 * layout.tables.n_switches
        routine = self._adding if layout.adding == "called" else Code()
        answer = code("movw ldi mov") + code("cp cpc brge movw ldi") * (layout.tables.n_classes - 1)
        if self._parts > 1:
            answer = code("ldi ldi ld ld ldi ldi ldi ldi ld ld cp cpc brge movw movw subi sbci cpi ldi cpc brne")
        assembly = self._guard("ldi cpse jmp") + self._classify + answer + code("ret") + routine + self._update
        if layout.adding == "unrolled":
            assembly += self._row * (len(self._steps) * self._parts)
        else:
            assembly += self._call * (len(self._steps) * self._parts)
        searching = self._search.flash if self._search else 0
        return tables + self._losing + assembly.size + searching + _GRASP + (_SET_SWITCH if layout.groups else 0)

    @property
    def _losing(self) -> int:
        """Bytes of flash of what replaces missing inputs by their means."""
        means = self._layout.means.size * (1 if self._layout.narrow_means else 2)
        loading = code("push push clr call pop pop movw subi sbci ret") + code("ld ld") * self._width
        losing = _LOSING if self._layout.groups else _LOSING_JOINTS
        return means + 2 * self._layout.tables.n_classes + loading.size + losing

    @property
    def ram(self) -> int:
        """Bytes of variables and of the deepest stack, return address included."""
        found = len(self._steps) - len(self._layout.groups) if self._search else 0
        scores = 4 * self._layout.tables.n_classes  # as they are, and as they begin where an input is missing
        lost = len(self._layout.ports) + -(-len(self._layout.joints) // 8) + _LOST_RAM
        return self._layout.frame_size + scores + len(self._steps) + found + lost + self._stack

    @property
    def _stack(self) -> int:
        # update: its return address, the registers kept, and within a change that of the change, a byte, of the adding
        deepest = 3 * self._counter + self._kept + 1
        return max(deepest, self._search.stack) if self._search else deepest

    @property
    def _kept(self) -> int:
        return 2 * max(self._width - _FREE_PAIRS, 0)

    @property
    def _call(self) -> Code:
        return code("rcall" if calls_are_near(self._layout) else "call")

    @property
    def _row(self) -> Code:
        return code("lpm add adc" if self._layout.entry_bits == 8 else "lpm add lpm adc") * self._width

    @property
    def _adding(self) -> Code:
        """What adds a row, wherever it stands: with its return, without the call."""
        return self._row + code("ret") if self._layout.adding == "called" else self._row

    @property
    def _to_row(self) -> Code:
        return code("ldi mul movw subi sbci clr" if self._layout.entry_bits == 8 else "ldi mul movw subi sbci")

    @property
    def _classify(self) -> Code:
        """All but the adding and the answer: saving, start, finding rows, storing, restoring."""
        at_once = min(self._width, _IMMEDIATE_PAIRS)
        start = code("ldi ldi") * at_once + code("ldi ldi movw") * (self._width - at_once)
        found = together(self._steps) + (code("lds") + self._to_row) * len(self._steps)
        passes = (_NOTHING_MISSING + start + found + code("ldi ldi") + code("st st") * self._width) * self._parts
        return passes + code("sts") * len(self._steps) + code("push pop") * self._kept + code("clr")

    @property
    def _update(self) -> Code:
        move = code("ldi ldi") + code("ld ld") * self._width
        compared = together(self._groups if self._coded else self._steps)
        steps = compared + (code("lds lds cpse") + self._call) * len(self._steps)
        passes = (move * 2 + steps + together(self._changes())) * self._parts
        routines = (self._row + code("ret")) * 2
        once = _NOTHING_TO_LEAVE + code("push") * self._kept + code("sts") * len(self._steps) + code("jmp")
        return passes + once + routines

    @property
    def _coded(self) -> bool:
        """Whether joints' codes are compared, and only then their rows found."""
        return self._layout.bins != "search" and self._layout.code_bits == 8

    def _changes(self) -> Iterator[Code]:
        """Yield what is done about each look-up that has changed, only the size of which matters here."""
        rows, jump = (self._to_row + self._call) * 2, code("rjmp" if calls_are_near(self._layout) else "jmp")
        groups, moved = len(self._layout.groups), self._to_row * 2 + self._call + jump
        for number, row_number in enumerate(self._steps):
            if number < groups and self._layout.entry_bits == 16:
                yield code("mov eor and push and breq pop tst breq ret") + rows
            elif number >= groups and self._coded:
                found = self._call * 2 + row_number + code("ret")
                yield code("push pop push mov pop cp breq push pop ret") + moved + found
            else:
                yield code("push pop") + moved

    def _changing(self) -> Iterator[Code]:
        """Yield what is done at most about each look-up that has changed, with what it calls."""
        added = self._row + code("ret")
        moved = self._to_row * 2 + self._call + code("rjmp" if calls_are_near(self._layout) else "jmp") + added * 2
        sizes = [len(numbers) for numbers in self._layout.groups]
        for number, row_number in enumerate(self._steps):
            if number < len(sizes) and self._layout.entry_bits == 16:
                both = sizes[number] > 1
                rows = (self._to_row + self._call + added) * (2 if both else 1)
                yield code("mov eor and push and breq pop tst ret") + code("breq" if both else "taken") + rows
            elif number >= len(sizes) and self._coded:
                found = self._call * 2 + (row_number + code("ret")) * 2
                yield code("push pop push mov pop cp breq push pop") + moved + found
            else:
                yield code("push pop") + moved

    def _row_number(self, joint: JointLayout) -> Code:
        """Return what makes r30, a joint's code, the number of its row. Both ways round a branch take as long."""
        if self._layout.bins == "search":
            return Code()
        if self._layout.bins == "direct":
            return code("ldi lpm")
        within = code("ldi subi sbci lpm")
        if self._layout.code_bits == 16:
            zero = code("clr") if self._layout.entry_bits == 16 else Code()
            return code("lds subi sbci brcc ldi ldi cpi cpc brlo ldi") + _CLAMPED * -1 + zero + within
        lower = code("subi brcc ldi") if joint.first else Code()
        upper = code("cpi brlo ldi") if joint.first + len(joint.bins) <= 255 else Code()
        return lower + upper + within

    def _clamps(self, joint: JointLayout) -> bool:
        return self._layout.bins == "trimmed" and self._layout.code_bits == 16 and not joint.constant

    def _guard(self, text: str) -> Code:
        """Return the check that tables lie within reach of lpm, where there is flash beyond it."""
        tables = 2 if self._layout.bins != "search" and len(self._steps) > len(self._layout.groups) else 1
        return code(text) * tables if self._counter == 3 else Code()


def worst_frame(layout: Layout) -> Frame:
    """Return bits (s,) and codes (j,) of a frame than which none was found to take longer on an AVR; the same one every
    time.

    All frames take the same instructions but where a class is better than all before it, a code of 16 bits lies below
    its bins, or a code is searched for. So the worst frame is the one that adds up most of these, alike on all parts.
    It is sought by a climb from random frames, one input at a time, and proved the worst where it reaches the bound.
    """
    costs = AvrCosts(layout, 0)
    random = np.random.default_rng(0)
    choices = [_codes(layout, number) for number in range(layout.tables.n_joints)]
    bits = random.random((_DRAWN, layout.tables.n_switches)) < 0.5
    codes = np.empty((_DRAWN, len(choices)), np.uint16)
    for column, some in zip(codes.T, choices, strict=True):
        column[:] = random.choice(some, _DRAWN)
    order = np.argsort(-costs.varying_cycles(bits, codes), kind="stable")[:_CLIMBED]
    climbed = [_climb(costs, (bits[row], codes[row]), choices) for row in order]
    return max(climbed, key=lambda frame: _cycles(costs, frame))


def _codes(layout: Layout, number: int) -> NDArray[np.uint16]:
    """Return codes of a joint that differ in row or time: the least of each bin and, below all bins, zero."""
    steps = layout.joints[number].thresholds.astype(np.int64) + 1
    return np.concatenate([[0], steps[steps < 1 << layout.code_bits]]).astype(np.uint16)


def _climb(costs: AvrCosts, frame: Frame, choices: list[NDArray[np.uint16]]) -> Frame:
    """Return what the frame becomes by taking, again and again, the best of those that differ in one input."""
    for _ in range(_ROUNDS):
        bits, codes = _neighbours(frame, choices)
        cycles = costs.varying_cycles(bits, codes)
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


def _cycles(costs: AvrCosts, frame: Frame) -> int:
    bits, codes = frame
    return int(costs.varying_cycles(bits[np.newaxis], codes[np.newaxis])[0])
