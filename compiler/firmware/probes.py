"""Frames that a compiled classifier is held against: extreme ones, all of a kind, and random ones."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import IntegerTables

_BYTE, _WORD = 0xFF, 0xFFFF
_CHANGING = 40


@dataclass(frozen=True, slots=True, eq=False)
class Probes:
    """n frames: switches `bits` (n, s) and joints' `codes` (n, j)."""

    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]

    def __len__(self) -> int:
        return len(self.bits)


def joined(*frames: Probes) -> Probes:
    """Return the frames one after the other."""
    return Probes(np.vstack([one.bits for one in frames]), np.vstack([one.codes for one in frames]))


def extreme_frames(tables: IntegerTables) -> Probes:
    """Return every frame that is extreme in one way while all else is at one end.

    Switches: all open, all closed, each closed alone, each open alone; every one of these with all joints at 0, and
    with all at the highest code. Joints: each at every code at which its row changes, and at the last one before, at 0
    and at the highest; with the others at 0 and all switches open, and with the others at the highest and all closed.
    So there are 4 (s + 1) + 2 (sum of the joints' `turns`) frames. The highest code is 255, or 65535 where thresholds
    are that high.
    """
    s, j, top = tables.n_switches, tables.n_joints, _top(tables)
    alone = np.eye(s, dtype=bool)
    patterns = np.vstack([np.zeros((1, s), bool), np.ones((1, s), bool), alone, ~alone])
    rests = [np.full((len(patterns), j), code, np.uint16) for code in (0, top)]
    frames = [Probes(patterns, rest) for rest in rests]
    for joint, (code, closed) in product(range(j), ((0, False), (top, True))):
        codes = turns(tables, joint)
        rest = np.full((len(codes), j), code, np.uint16)
        rest[:, joint] = codes
        frames.append(Probes(np.full((len(codes), s), closed), rest))
    return joined(*frames)


def changing_frames(tables: IntegerTables) -> Probes:
    """Return 40 frames of which each changes every input from the one before: of neighbouring switches one opens and
    the other closes, and joints go from 0 to the highest code or back.
    """
    odd = np.arange(_CHANGING)[:, np.newaxis] % 2
    bits = np.arange(tables.n_switches) % 2 == odd
    return Probes(bits, np.tile(np.where(odd, _top(tables), 0), (1, tables.n_joints)).astype(np.uint16))


def random_frames(tables: IntegerTables, n: int, seed: int) -> Probes:
    """Return n frames, the same for a seed on any machine.

    Switches close with a probability of a frame's own. Codes of even frames are drawn from all there are, of odd ones
    from those at which a joint's row changes, so that changes of several joints meet.
    """
    random, top = np.random.Generator(np.random.PCG64(seed)), _top(tables)
    bits = random.random((n, tables.n_switches)) < random.random((n, 1))
    codes = random.integers(0, top, (n, tables.n_joints), dtype=np.uint16, endpoint=True)
    for joint in range(tables.n_joints):
        at = turns(tables, joint)
        codes[1::2, joint] = at[random.integers(0, len(at), len(codes[1::2]))]
    return Probes(bits, codes)


def turns(tables: IntegerTables, joint: int) -> NDArray[np.uint16]:
    """Return, in order, 0, each threshold of a joint and the code after it, and the highest code."""
    thresholds = tables.thresholds[joint].astype(np.int64)
    codes = np.unique(np.concatenate([[0, _top(tables)], thresholds, thresholds + 1]))
    return codes[codes <= _top(tables)].astype(np.uint16)


def _top(tables: IntegerTables) -> int:
    wide = any(len(thresholds) and thresholds[-1] >= _BYTE for thresholds in tables.thresholds)
    return _WORD if wide else _BYTE
