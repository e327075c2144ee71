"""Cycles of the binary search for a code's row on an AVR: find() and below() of the classifier's C.

Counted from what avr-gcc 5.4 makes of them with -Os. Another compiler may make something else of them: where cycles
matter, there are layouts without a search.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .avr_instructions import code
from .joint_layout import JointLayout

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


class Search:
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
