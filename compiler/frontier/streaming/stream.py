"""`Stream`: the states of a glove one after the other, and when a grasp is complete."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """T states of a glove; each lasts until the next, the last is the end and lasts for no time.

    bits      (T, s) bool     every switch of the set
    codes     (T, j) uint16   the joints
    at_us     (T,) int64      when each begins, never falling
    types     (T,) intp       the class of the grasp; -1 while the hand moves
    arrivals  (g,) intp       the states at which a grasp is complete, if its type is not that of the grasp before: one
                              that is may be decided on from before, which tells nothing
    ends      (g,) intp       the states at which these grasps no longer are
    what      a sentence: what the stream is, and why this one
    """

    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    at_us: NDArray[np.int64]
    types: Rows
    arrivals: Rows
    ends: Rows
    what: str = ""

    def __len__(self) -> int:
        return len(self.at_us)


def stream_from(
    *,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    at_us: NDArray[np.int64],
    end_us: int,
    arrivals: Rows,
    ends: Rows,
    grasps: Rows,
    what: str,
) -> Stream:
    """Return the stream of states that end at end_us; all grasps (g,), classes `grasps`, are told, in order."""
    types = np.full(len(at_us) + 1, -1, np.intp)
    for arrival, end, grasp in zip(arrivals.tolist(), ends.tolist(), grasps.tolist(), strict=True):
        types[arrival:end] = grasp
    another = np.concatenate([[True], grasps[1:] != grasps[:-1]])
    return Stream(
        bits=np.vstack([bits, bits[-1:]]),
        codes=np.vstack([codes, codes[-1:]]),
        at_us=np.append(at_us, np.int64(end_us)),
        types=types,
        arrivals=arrivals[another],
        ends=ends[another],
        what=what,
    )
