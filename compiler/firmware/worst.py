"""The frame for which classify takes longest.

All frames take the same instructions but where a class is better than all before it, a code of 16 bits lies below its
bins, or a code is searched for (avr_costs). So the worst frame is the one that adds up most of these. It is sought by a
climb from random frames, one input at a time, and proved the worst where it reaches the static bound of the costs.
"""

import numpy as np
from numpy.typing import NDArray

from .avr_costs import AvrCosts
from .layout import Layout
from .targets import TARGETS, Target

__all__ = ["worst_frame"]

Frame = tuple[NDArray[np.bool_], NDArray[np.uint16]]

_DRAWN, _CLIMBED, _ROUNDS = 4096, 8, 20


def worst_frame(layout: Layout, target: Target | None = None) -> Frame:
    """Return bits (s,) and codes (j,) of a frame than which none was found to take longer on `target`, an AVR; the same
    one every time. The ATmega328P is taken where none is given: what frames differ in is alike on all.
    """
    costs = AvrCosts(layout, target or TARGETS["atmega328p"])
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
