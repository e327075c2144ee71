"""A few frames and Python's answers to them as C, so that a folder of firmware can test itself without Python."""

import hashlib
from collections.abc import Sequence
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from thenar.firmware_templates.rendering import render

from .layout import Layout
from .probes import Probes, turns
from .words import string

DRAWN = 16  # frames beside the two extreme ones
CHECKS = DRAWN + 2
_WIDTH = 120


def check_header(name: str, layout: Layout, grasps: Sequence[str]) -> str:
    """Return the text of thenar_NAME_check.h: frames, their answers, the types' names, and a function that compares."""
    frames = self_test_frames(layout)
    what = ("every switch open, lowest codes", "every switch closed, highest codes", *DRAWN * ("drawn",))
    answers = layout.scores(frames.bits, frames.codes)
    rows = zip(what, np.packbits(frames.bits, axis=1, bitorder="little"), frames.codes, answers, strict=True)
    checks = [_check(*row) for row in rows]
    values = {"name": name, "upper": name.upper(), "classes": len(layout.start), "count": len(checks)}
    inputs = {"switches": layout.tables.n_switches, "joints": layout.tables.n_joints}
    return render("checking/check.h.j2", **values, **inputs, checks=checks, names=[string(each) for each in grasps])


def self_test_frames(layout: Layout) -> Probes:
    """Return the frames: the two extreme ones, then drawn ones, whose codes are those at which a joint's row changes.

    They are drawn from a hash: the same build has the same ones with every release of numpy.
    """
    s, turning = layout.tables.n_switches, [turns(layout.tables, joint) for joint in range(layout.tables.n_joints)]
    draws = _drawn(DRAWN, s + len(turning))
    taken = [[0, codes[-1], *codes[draws[:, s + joint] % len(codes)]] for joint, codes in enumerate(turning)]
    bits = np.vstack([np.zeros((1, s), bool), np.ones((1, s), bool), draws[:, :s] % 2 == 1])
    return Probes(bits, np.array(taken, np.uint16).reshape(len(turning), CHECKS).T)


def _drawn(rows: int, columns: int) -> NDArray[np.uint16]:
    stream = hashlib.shake_256(b"thenar self test").digest(2 * rows * columns)
    return np.frombuffer(stream, "<u2").astype(np.uint16).reshape(rows, columns)


def _check(
    what: str, closed: NDArray[np.uint8], codes: NDArray[np.uint16], scores: NDArray[np.int64]
) -> dict[str, object]:
    """Return what a frame is, the lines of its members' initialisers, and of its answer's."""
    members = ([f"{byte:#04x}" for byte in closed.tolist()], [str(code) for code in codes.tolist()])
    return {
        "what": what,
        "members": [_wrapped(words, 12) for words in members if words],
        "grasp": int(scores.argmax()),
        "scores": _wrapped([str(score) for score in scores.tolist()], 12),
    }


def _wrapped(words: list[str], indent: int) -> list[str]:
    """Return the words as lines of an initialiser that stands `indent` columns in."""
    return wrap(", ".join(words), _WIDTH - indent)
