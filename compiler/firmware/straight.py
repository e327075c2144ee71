"""Straight-line code for an AVR in the place of the core's `thenar_sum`, for tables of switches and lines alone.

The sums of up to 13 grasp types are in registers, low bytes in r2 to r14 and high bytes in r16 to r28, while joints are
multiplied and closed switches added; more types take another pass. An entry of 0 costs nothing, and a multiple of 256
one instruction. r15 holds a distance or a byte of switches, r29 constants, and Z points into the hand's memory.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import wrap

import numpy as np

from thenar.runtime.model.terms.line import Line

from .layout import Layout

_TYPES = 13  # in registers
_REACH = 62  # the largest displacement of a word from Z
_KEPT = {*range(2, 18), 28, 29}  # registers that a function restores
_COLUMNS = 100
# The hand is in r24 and r25; the pointer to its memory is at byte 4.
_BEGIN = ("movw r30, r24", "ldd r0, Z+4", "ldd r31, Z+5", "mov r30, r0")
# Cycles of instructions that take more than one. A branch and what it skips take as long as its other way, or longer.
_CYCLES = {"ldd": 2, "std": 2, "push": 2, "pop": 2, "mul": 2, "ret": 4}


Step = tuple[str, tuple[str, ...]]
"""What it does; its instructions and labels."""


@dataclass(frozen=True, slots=True)
class Straight:
    """The function, step by step."""

    steps: tuple[Step, ...]

    @property
    def statements(self) -> list[tuple[str, list[str]]]:
        """The steps, with the lines of strings for an asm statement."""
        strings = [" ".join(f'"{line}\\n"'.replace(" ", "\xa0") for line in code) for _, code in self.steps]
        lines = [[line.replace("\xa0", " ") for line in wrap(string, _COLUMNS)] for string in strings]
        return [(what, each) for (what, _), each in zip(self.steps, lines, strict=True)]

    @property
    def instructions(self) -> list[str]:
        """The names of the instructions, each of which takes two bytes."""
        return [line.split()[0] for _, code in self.steps for line in code if not line.endswith(":")]

    @property
    def cycles(self) -> int:
        """The cycles of the slowest frame: all switches are closed."""
        return sum(_CYCLES.get(name, 1) for name in self.instructions)


def straight(layout: Layout) -> Straight | None:
    """Return the function for tables of switches and lines alone; None for others."""
    tables = layout.tables
    if layout.binned or tables.grids:
        return None
    adds = np.any([layout.start, *(slope.row for slope in tables.lines), *tables.switch_rows], axis=0)
    types, zeros = np.flatnonzero(adds).tolist(), np.flatnonzero(~adds).tolist()
    sums = {2 + at for at in range(min(len(types), _TYPES))}
    saved = sorted(_KEPT & (sums | {14 + low for low in sums} | {15, 29}))
    return Straight(
        (
            ("the hand's memory", (*(f"push r{register}" for register in saved), *_BEGIN)),
            *_Writer(layout).steps([types[at : at + _TYPES] for at in range(0, len(types), _TYPES)], zeros),
            ("the end", (*(f"pop r{register}" for register in reversed(saved)), "ret")),
        )
    )


class _Writer:
    """The steps between beginning and end, in which Z moves along the hand's memory."""

    def __init__(self, layout: Layout) -> None:
        self._layout, self._place = layout, 0
        self._codes = 2 * -(-layout.tables.n_switches // 16)

    def steps(self, passes: Sequence[Sequence[int]], zeros: Sequence[int]) -> Iterator[Step]:
        """Yield the steps of passes of grasp types, each with sums in registers, and of types that add `zeros`."""
        tables = self._layout.tables
        for types in passes:
            yield "what no input changes", tuple(_start(self._layout.start[list(types)].tolist()))
            for slope in tables.lines:
                if products := _products(slope.row[list(types)].tolist()):
                    yield f"joint {slope.joint}", (*self._distance(slope), *products)
            for first in range(0, tables.n_switches, 8):
                bits = tables.bits[first : first + 8]
                code = self._word("ldd", ("r15",), first // 8)
                for number, bit in enumerate(bits):
                    code += _closed(number, bit.row[list(types)].tolist())
                yield f"switches {first} to {first + len(bits) - 1}", tuple(code)
            code = [line for at, k in enumerate(types) for line in self._score((f"r{2 + at}", f"r{16 + at}"), k)]
            yield "the scores", tuple(code)
        yield "scores of 0", ("clr r1", *(line for k in zeros for line in self._score(("r1", "r1"), k)))

    def _score(self, registers: tuple[str, str], k: int) -> list[str]:
        return self._word("std", registers, self._layout.frame_size + 2 * k)

    def _word(self, how: str, registers: Sequence[str], place: int) -> list[str]:
        """Return instructions that load or store registers at a place of the memory."""
        code = []
        if not 0 <= place - self._place <= _REACH:
            back, self._place = self._place - place, place
            code = [f"subi r30, lo8({back})", f"sbci r31, hi8({back})"]
        at = [f"Z+{place - self._place + byte}" for byte in range(len(registers))]
        pairs = zip(registers, at, strict=True)
        return code + [f"ldd {register}, {z}" if how == "ldd" else f"std {z}, {register}" for register, z in pairs]

    def _distance(self, slope: Line) -> list[str]:
        """Return instructions that put the distance of a joint's code from the lowest one into r15."""
        span = slope.high - slope.low
        code = self._word("ldd", ("r15", "r0"), self._codes + 2 * slope.joint)
        code += ["clr r1", f"ldi r29, {slope.low & 255}", "sub r15, r29"]
        code += [f"ldi r29, {slope.low >> 8}", "sbc r0, r29"] if slope.low > 255 else ["sbc r0, r1"]
        code += ["brcc 1f", "clr r15", "clr r0", "1:"]
        code += [f"ldi r29, {span >> 8}", "mov r1, r29"] if span > 255 else []
        code += [f"ldi r29, {span & 255}", "cp r29, r15", "cpc r1, r0", "brcc 1f", "mov r15, r29"]
        code += ["mov r0, r1", "1:"] if slope.shift < 0 else ["1:"]
        return code + ["lsl r15"] * slope.shift + ["lsr r0", "ror r15"] * -slope.shift


def _start(row: Sequence[int]) -> list[str]:
    """Return instructions that begin the sums."""
    code = []
    for at, entry in enumerate(row):
        code += [f"ldi r29, {entry & 255}", f"mov r{2 + at}, r29"] if entry & 255 else [f"clr r{2 + at}"]
        code.append(f"ldi r{16 + at}, {entry >> 8 & 255}")
    return code


def _products(row: Sequence[int]) -> list[str]:
    """Return instructions that add the products of r15 and a row."""
    code = []
    for at, entry in enumerate(row):
        if entry:
            how = ("add", "adc") if entry > 0 else ("sub", "sbc")
            code += [f"ldi r29, {abs(entry)}", "mul r15, r29", f"{how[0]} r{2 + at}, r0", f"{how[1]} r{16 + at}, r1"]
    return code


def _closed(bit: int, row: Sequence[int]) -> list[str]:
    """Return instructions that add a row where a bit of r15 is set."""
    code = []
    for at, entry in enumerate(row):
        if entry % 256:
            code += [f"ldi r29, {entry & 255}", f"add r{2 + at}, r29", f"ldi r29, {entry >> 8 & 255}"]
            code.append(f"adc r{16 + at}, r29")
        elif entry:
            code.append(f"subi r{16 + at}, {-(entry >> 8) & 255}")
    if len(code) < 2:
        return [f"sbrc r15, {bit}", *code] if code else []
    return [f"sbrs r15, {bit}", "rjmp 1f", *code, "1:"]
