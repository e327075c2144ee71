"""Test frames for a compiled classifier, in bytes, the predictions for them, and a few of both as C.

Some frames are extreme, and the others are random. With the C a firmware folder tests itself.
"""

import hashlib
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thenar.firmware_templates.rendering import render
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.segmenting.decoder import Decoder
from thenar.runtime.segmenting.model import SegmentModel

from . import FirmwareError
from .classifier import lag_of
from .layout import Layout

Frames = NDArray[np.uint8]
Lost = NDArray[np.bool_]
Unit = Literal["cycles", "instructions", ""]
STREAM_TICKS = 200
"""The frames that a program's decoder of segments takes before it begins afresh."""


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """The predictions for n frames: scores (n, K) int16, and classes (n,), the first of the best.

    margins, shares  the lead over the second best (n,), and the probability of one class each (n,), in 65535ths: of
                     class 0 in frame 0, 1 in frame 1 and so on, cyclically; None where not requested
    cost   the cost of each prediction (n,) in `unit`; None where nothing was counted (unit "")
    stack  bytes of stack that a prediction needs; None where not measured
    names  of the K types, as the program returned them; None where not requested
    states  of the decoder of segments at each frame (n,), which begins afresh every `STREAM_TICKS` frames; None where
            the program has none
    """

    scores: NDArray[np.int16]
    classes: NDArray[np.uint16]
    margins: NDArray[np.uint16] | None = None
    shares: NDArray[np.uint16] | None = None
    cost: NDArray[np.uint32] | None = None
    unit: Unit = ""
    stack: int | None = None
    names: tuple[str, ...] | None = None
    states: NDArray[np.uint16] | None = None

    @property
    def most(self) -> int:
        """The cost of the slowest prediction, 0 where nothing was counted."""
        return 0 if self.cost is None else int(self.cost.max())


def sent_frames(frames: Frames, lost: Lost | None, layout: Layout) -> Frames:
    """Return the frames (n, F) as programs read them: first a bit for each input that is `lost` (n, s + j), switches
    first, unless that is None.

    Raises FirmwareError unless `frames` is uint8 (n, F).
    """
    size = layout.frame_size
    if frames.dtype != np.uint8 or frames.ndim != 2 or frames.shape[1] != size:
        raise FirmwareError(f"frames are {frames.dtype} {frames.shape}, but this layout takes uint8 (n, {size})")
    return frames if lost is None else np.hstack([np.packbits(lost, axis=1, bitorder="little"), frames])


def answers_in(printed: bytes, frames: int, layout: Layout) -> Predictions:
    """Return the predictions that a program printed: the names of the K types, each followed by a zero; then for each
    frame K scores, a class, a margin and a probability, and a state where it decodes segments, 16 bits each,
    little-endian.

    Raises FirmwareError if there are fewer names, or not as many predictions as frames.
    """
    classes = layout.tables.n_classes
    *names, rest = printed.split(b"\0", classes)
    if len(names) < classes:
        raise FirmwareError(f"the program printed {len(names)} names for {classes} grasp types")
    size = classes + 3
    if len(rest) not in (whole := [2 * each * frames for each in (size, size + 1)]):
        raise FirmwareError(f"the program printed {len(rest)} bytes for {frames} frames of {2 * size} bytes")
    with_states = frames > 0 and len(rest) == whole[1]
    words = np.frombuffer(rest, "<u2").astype(np.uint16).reshape(frames, size + with_states)
    scores, (best, margins, shares) = words[:, :classes].view(np.int16), words[:, classes:size].T
    states = words[:, size] if with_states else None
    said = tuple(name.decode(errors="replace") for name in names)
    return Predictions(scores, best, margins, shares, names=said, states=states)


def states_of(model: SegmentModel, scores: NDArray[np.integer], refused: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """Return the states that a program prints for the scores (n, n_lanes) of frames, of which some are `refused`: those
    of Python's decoder, which begins afresh every `STREAM_TICKS` frames.
    """
    states: list[int] = []
    for number, (lanes, no) in enumerate(zip(scores.tolist(), refused.tolist(), strict=True)):
        if number % STREAM_TICKS == 0:
            decoder = Decoder(model, lag_of(model))
        states.append(decoder.push(lanes, refused=no).state)
    return np.array(states, np.uint16)


def record_files(
    name: str, layout: Layout, machine: Literal["host", "avr", "micropython"], *, lost: bool, segments: bool = False
) -> dict[str, str]:
    """Return the files, name -> text, of the program that classifies every frame with the tables `name`.

    It reads what `sent_frames` returns, with inputs that are `lost` or not, and writes what `answers_in` takes: from
    stdin to stdout, in MicroPython from the file "frames" to the file "predictions", and on an AVR in memory. With
    `segments`, it also pushes each to the decoder of segments; a module of MicroPython knows whether it has one.
    """
    tables = layout.tables
    lost_bytes = -(-(tables.n_switches + tables.n_joints) // 8) if lost else 0
    values = {"name": name, "layout": layout, "tables": tables, "lost_bytes": lost_bytes, "segments": segments}
    values["stream_ticks"] = STREAM_TICKS
    if machine == "micropython":
        return {"main.py": render("checking/record.py.j2", **values)}
    files = {"main.c": render(f"checking/{machine}_main.c.j2", **values)}
    if machine == "avr" and not lost:
        return files
    return files | {"record.h": render("checking/record.h.j2", **values)}


_BYTE, _WORD = 0xFF, 0xFFFF
_BETWEEN = 9  # codes of a slope, its ends included


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
    """Return every frame that is extreme in one way while all other inputs are at one end.

    Switches: all open, all closed, each closed alone, each open alone; every one of these with all joints at 0, and
    with all at the highest code. Joints: each at every code at which its row changes, and at the last one before, at 0
    and at the highest; with the others at 0 and all switches open, and with the others at the highest and all closed.
    So there are 4 (s + 1) + 2 (sum of the joints' `turns`) frames. The highest code is 255, or 65535 where thresholds
    exceed 255.
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


def random_frames(tables: IntegerTables, n: int, seed: int) -> Probes:
    """Return n frames, the same for a seed on any machine.

    Each frame has a separate probability of closed switches. Codes of even frames are drawn from the whole range, of
    odd ones from those at which a joint's row changes, so that changes of several joints coincide.
    """
    random, top = np.random.Generator(np.random.PCG64(seed)), _top(tables)
    bits = random.random((n, tables.n_switches)) < random.random((n, 1))
    codes = random.integers(0, top, (n, tables.n_joints), dtype=np.uint16, endpoint=True)
    for joint in range(tables.n_joints):
        at = turns(tables, joint)
        codes[1::2, joint] = at[random.integers(0, len(at), len(codes[1::2]))]
    return Probes(bits, codes)


def lost_inputs(tables: IntegerTables, n: int, seed: int) -> Lost:
    """Return the missing inputs, switches first, of n frames (n, s + j): in even frames a single one, each in turn, in
    odd frames each with a probability that varies by frame, and in the last frame all.
    """
    random, inputs = np.random.Generator(np.random.PCG64(seed)), tables.n_switches + tables.n_joints
    lost = random.random((n, inputs)) < random.random((n, 1))
    lost[::2] = np.arange(inputs) == np.arange(len(lost[::2]))[:, np.newaxis] % inputs
    lost[-1:] = True
    return lost


def turns(tables: IntegerTables, joint: int) -> NDArray[np.uint16]:
    """Return, in order, 0, each threshold of a joint, the code after it, and the highest code; for a joint with a
    slope, also codes near its ends and some between.
    """
    thresholds, top = tables.steps_of(joint), _top(tables)
    codes = np.concatenate([[0, top], thresholds, thresholds + 1])
    for slope in (slope for slope in tables.lines if slope.joint == joint):
        between = np.linspace(slope.low, slope.high, _BETWEEN).astype(np.int64)
        codes = np.concatenate([codes, between, [abs(slope.low - 1), slope.low + 1, slope.high - 1, slope.high + 1]])
    codes = np.unique(codes)
    return codes[codes <= top].astype(np.uint16)


def _top(tables: IntegerTables) -> int:
    steps = [int(steps[-1]) for term in (*tables.bins, *tables.grids) for steps in term.steps if len(steps)]
    return _WORD if max([0, *steps, *(slope.high - 1 for slope in tables.lines)]) >= _BYTE else _BYTE


DRAWN = 16  # frames in addition to the two extreme ones
CHECKS = DRAWN + 2


def check_header(name: str, layout: Layout) -> str:
    """Return thenar_NAME_check.h: frames, the expected predictions, and a function that compares."""
    frames = self_test_frames(layout)
    what = ("every switch open, lowest codes", "every switch closed, highest codes", *DRAWN * ("drawn",))
    packed = np.packbits(frames.bits, axis=1, bitorder="little").tolist()
    closed = [[f"{byte:#04x}" for byte in row] for row in packed]
    scores = layout.tables.scores(frames.bits, frames.codes)
    grasps = scores.argmax(axis=1).tolist()
    checks = list(zip(what, closed, frames.codes.tolist(), grasps, scores.tolist(), strict=True))
    return render("checking/check.h.j2", name=name, tables=layout.tables, checks=checks)


def self_test_frames(layout: Layout) -> Probes:
    """Return the frames: the two extreme ones, then drawn ones, whose codes are those at which a joint's row changes.

    They are drawn from a hash: the same build has the same frames with every release of numpy.
    """
    s, turning = layout.tables.n_switches, [turns(layout.tables, joint) for joint in range(layout.tables.n_joints)]
    stream = hashlib.shake_256(b"thenar self test").digest(2 * DRAWN * (s + len(turning)))
    draws = np.frombuffer(stream, "<u2").astype(np.uint16).reshape(DRAWN, s + len(turning))
    taken = [[0, codes[-1], *codes[draws[:, s + joint] % len(codes)]] for joint, codes in enumerate(turning)]
    bits = np.vstack([np.zeros((1, s), bool), np.ones((1, s), bool), draws[:, :s] % 2 == 1])
    return Probes(bits, np.array(taken, np.uint16).reshape(len(turning), CHECKS).T)
