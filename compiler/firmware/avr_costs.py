"""Cycles, flash and RAM of the classifier on an AVR, counted from the instructions of its template.

Every piece below is what firmware_templates/classifier/thenar_NAME_avr.S.j2 says in that place, mnemonic by mnemonic.
All frames take the same way through it but for three things: each class that is better than all before it costs a
cycle, a code of 16 bits below a joint's bins another, and a search for a code's row depends on the code. The search is
C: its cycles are those of avr-gcc 5.4 with -Os.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .assembly import calls_are_near
from .avr_instructions import Code, code, together
from .joint_layout import JointLayout
from .layout import Layout
from .parts import parts_of
from .searching import Search
from .targets import Target

# Pairs of registers that a function need not keep, and those that can be loaded with a constant; as in assembly.py.
_FREE_PAIRS, _IMMEDIATE_PAIRS = 5, 7

# Bytes of C code, rounded up; a table of bins begins at a page, and the compiler fills up its last one.
_SET_SWITCH, _GRASP, _PAGE = 80, 40, 256


# What a code of 16 bits below a joint's bins takes more than others.
_CLAMPED = Code(1)


class AvrCosts:
    """The costs of a layout on an AVR of `counter_bytes`, 2 or 3, in its program counter."""

    __slots__ = ("_counter", "_layout", "_parts", "_search", "_steps", "_width")

    def __init__(self, layout: Layout, target: Target) -> None:
        parts = parts_of(layout.tables.n_classes)
        self._layout, self._parts, self._width = layout, len(parts.firsts), parts.width
        self._counter = 3 if target.flash > 128 << 10 else 2
        joints = [joint for joint in layout.joints if not joint.constant]
        searched = layout.bins == "search" and joints
        self._search = Search(joints, layout.code_bits, self._counter) if searched else None
        self._steps = [code("")] * len(layout.groups) + [self._row_number(joint) for joint in joints]

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
        compared = Code() if self._coded else together(self._steps)
        steps = compared + (code("lds lds cpse") + self._call) * len(self._steps)
        passes = (move + steps + together(self._changing())) * self._parts
        stored_twice = self._width * self._parts - self._layout.tables.n_classes  # in classify alone
        once = code("push pop") * self._kept + code("sts") * len(self._steps) + code("jmp clr") + self._answering
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
        if len(layout.groups) > 255:
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
        return tables + assembly.size + searching + _GRASP + (_SET_SWITCH if layout.groups else 0)

    @property
    def update_flash(self) -> int:
        """Bytes of `flash` that are update()'s alone, which stands in a section of its own."""
        return self._update.size

    @property
    def ram(self) -> int:
        """Bytes of variables and of the deepest stack, return address included."""
        found = len(self._steps) - len(self._layout.groups) if self._search else 0
        scores = 2 * self._layout.tables.n_classes
        return self._frame_bytes + scores + len(self._steps) + found + self._stack

    @property
    def _frame_bytes(self) -> int:
        layout = self._layout
        return len(layout.groups) + layout.padding + layout.tables.n_joints * layout.code_bits // 8

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
        passes = (start + found + code("ldi ldi") + code("st st") * self._width) * self._parts
        return passes + code("sts") * len(self._steps) + code("push pop") * self._kept + code("clr")

    @property
    def _update(self) -> Code:
        move = code("ldi ldi") + code("ld ld") * self._width
        compared = Code() if self._coded else together(self._steps)
        steps = compared + (code("lds lds cpse") + self._call) * len(self._steps)
        passes = (move * 2 + steps + together(self._changes())) * self._parts
        routines = (self._row + code("ret")) * 2
        return passes + code("push") * self._kept + code("sts") * len(self._steps) + code("jmp") + routines

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
