"""Cycles and bytes of an AVR's instructions, as far as the classifier's assembly has them."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

# AVR Instruction Set Manual, DS40002198, table 5-1: cores AVRe (ATmega328P) and AVRe+ (ATmega2560), whose program
# counter of three bytes makes calls and returns a cycle longer. A conditional branch is one that is not taken.
_ONE = "adc add and brcc breq brge brlo brne clr cp cpc cpi cpse eor ldi mov movw sbc sbci sub subi tst"
_TWO = "ld lds mul pop push rjmp st sts taken"
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
