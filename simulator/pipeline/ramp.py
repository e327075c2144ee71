"""The growth of forces with the grip: linear between levels, from 0 at the first touch."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats

Integers = NDArray[np.int64]
Bits = NDArray[np.bool_]

# The time of a switch that never closes or never opens.
NEVER = np.iinfo(np.int64).max


@dataclass(frozen=True, slots=True, eq=False)
class Ramp:
    """forces_n (levels + 1, n, s) at even steps of the grip, the first at contact, the last at rise_us."""

    forces_n: Floats
    rise_us: float

    def forces_at(self, at_us: Integers, places: Sequence[int], let_go_us: int | None) -> Floats:
        """Return the forces (n, F, t) on some places at times (n, F, t or 1). From let_go_us on, they fall as they
        grew; None: no release.
        """
        forces = self.forces_n[:, :, places]
        levels = len(forces) - 1
        since = at_us if let_go_us is None else np.minimum(at_us, let_go_us + self.rise_us - at_us)
        way = np.clip(since / self.rise_us, 0.0, 1.0) * levels
        below = np.minimum(way.astype(np.intp), levels - 1)
        shape = (*at_us.shape[:2], len(places))
        below, part = np.broadcast_to(below, shape), np.broadcast_to(way - below, shape)
        rows, columns = np.arange(shape[0])[:, None, None], np.arange(shape[2])
        first = forces[below, rows, columns]
        grown: Floats = first + part * (forces[below + 1, rows, columns] - first)
        return grown

    def reached_us(self, newtons: float) -> Integers:
        """Return the first time (n,) at which any place bears more than this, or NEVER."""
        thresholds = np.full(self.forces_n.shape[2], newtons)
        first: Integers = crossings(self.forces_n, thresholds, self.rise_us / (len(self.forces_n) - 1))[0].min(axis=1)
        return first


def crossings(forces_n: Floats, thresholds_n: Floats, level_us: float) -> tuple[Integers, Integers]:
    """Return the times (n, s) at which each switch first closes and last opens, or NEVER.

    forces_n (levels + 1, n, s) come level_us apart, the first at 0; thresholds_n (s,). One that is closed at the end
    does not open.
    """
    closed = forces_n > thresholds_n
    levels = len(closed) - 1
    first, last = closed.argmax(axis=0), levels - closed[::-1].argmax(axis=0)
    up = np.where(first > 0, _between(forces_n, thresholds_n, np.maximum(first - 1, 0)) * level_us, 0.0)
    down = _between(forces_n, thresholds_n, np.minimum(last, levels - 1)) * level_us
    ever: Bits = np.logical_or.reduce(closed)
    return _times(up, ever), _times(down, np.greater(ever, closed[-1]))


def _between(forces_n: Floats, thresholds_n: Floats, level: NDArray[np.intp]) -> Floats:
    """Return the fractional level at which the force passes the threshold, or the level itself if it does not: dividing
    by a tiny change would overflow.
    """
    here = np.take_along_axis(forces_n, level[None], axis=0)[0]
    change = np.take_along_axis(forces_n, level[None] + 1, axis=0)[0] - here
    left = thresholds_n - here
    passes = (np.abs(left) <= np.abs(change)) & (change != 0.0)
    levels: Floats = level + np.where(passes, left, 0.0) / np.where(passes, change, 1.0)
    return levels


def _times(time_us: Floats, known: Bits) -> Integers:
    return np.where(known, np.ceil(np.where(known, time_us, 0.0)).astype(np.int64), NEVER)
