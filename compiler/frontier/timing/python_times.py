"""The time of classifying a frame in Python on this machine: tables of many shapes timed, and a linear fit."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.scores import Scorer

from ...firmware.probes import random_frames

# Shapes that are timed: switches, joints, grasp types.
_SWITCHES, _JOINTS, _CLASSES = (0, 1, 4, 8, 16, 33, 66, 160), (0, 16, 22), (4, 14, 33)
YARDSTICK = (33, 16, 14)
_BINS, _REACH, _HIGHEST = 8, 60, 254
_FRAMES, _PASSES = 20, 20


@dataclass(frozen=True, slots=True)
class PythonCost:
    """Microseconds a frame: a constant, and per switch, joint, class, (switch, class) and (joint, class).

    yardstick  time of tables of the shape YARDSTICK during the fit: the machine's speed
    """

    constant: float
    switch: float
    joint: float
    klass: float
    switch_class: float
    joint_class: float
    yardstick: float

    def us(self, tables: IntegerTables) -> float:
        """Return the mean time over frames of `runtime.scores` and finding the best class."""
        return float(_features(tables.n_switches, tables.n_joints, tables.n_classes) @ np.array(self._weights))

    @property
    def _weights(self) -> tuple[float, ...]:
        return self.constant, self.switch, self.joint, self.klass, self.switch_class, self.joint_class


def fit_here() -> PythonCost:
    """Time tables of many shapes on this machine and fit them by least relative squares, no weight below 0.

    Takes about a second, and differs from one run to the next with the machine's speed.
    """
    from scipy.optimize import nnls

    shapes = [shape for shape in product(_SWITCHES, _JOINTS, _CLASSES) if shape[0] + shape[1]]
    taken = np.array(classify_us([random_tables(*shape) for shape in shapes]))
    rows = np.array([_features(*shape) for shape in shapes])
    weights, _ = nnls(rows / taken[:, np.newaxis], np.ones(len(taken)))
    return PythonCost(*[*weights.tolist(), float(taken[shapes.index(YARDSTICK)])])


def classify_us(several: Sequence[IntegerTables], yardstick: float | None = None) -> list[float]:
    """Return the time of classifying a frame here with each of the tables, as `Build.classify` does it, but without the
    check for unusual frames: the mean over random frames.

    yardstick  microseconds of tables of the shape YARDSTICK at the reference speed; None: at the current speed

    For every frame the least of several passes over all tables counts: other work on the machine only adds time, and a
    busy moment affects all of them. But clocks, and neighbours of a virtual machine, change its speed for minutes, by
    half and more: so the yardstick is timed in the same passes.
    """
    timed = [_Timed(tables) for tables in (*several, random_tables(*YARDSTICK))]
    for _ in range(_PASSES):
        for each in timed:
            each.run()
    *found, now = (1e6 * sum(each.least_s) / _FRAMES for each in timed)
    return [us if yardstick is None else us * yardstick / now for us in found]


class _Timed:
    """Tables in the runtime's form, frames, and the least time of each frame so far."""

    def __init__(self, tables: IntegerTables) -> None:
        probes = random_frames(tables, _FRAMES, seed=1)
        self._scorer = Scorer(tables)
        self._frames = list(zip(probes.bits, probes.codes, strict=True))
        self.least_s = [float("inf")] * _FRAMES

    def run(self) -> None:
        """Classify every frame once."""
        for number, (bits, codes) in enumerate(self._frames):
            start = time.perf_counter()
            lanes = self._scorer.lanes(bits, codes)
            lanes.index(max(lanes))
            self.least_s[number] = min(self.least_s[number], time.perf_counter() - start)


def _features(switches: int, joints: int, classes: int) -> NDArray[np.float64]:
    return np.array([1, switches, joints, classes, switches * classes, joints * classes], float)


def random_tables(switches: int, joints: int, classes: int) -> IntegerTables:
    """Return tables of that shape, always the same, with 8 rows a joint: their values do not affect the time."""
    random = np.random.default_rng(switches + 1000 * joints)

    def rows(*shape: int) -> NDArray[np.int16]:
        return random.integers(-_REACH, _REACH, (*shape, classes), np.int16, endpoint=True)

    return IntegerTables.of(
        bias=rows(),
        switch_rows=rows(switches),
        thresholds=tuple(
            np.sort(random.choice(_HIGHEST, _BINS - 1, replace=False)).astype(np.uint16) for _ in range(joints)
        ),
        joint_rows=tuple(rows(_BINS) for _ in range(joints)),
        switch_means=rows(switches),
        joint_means=rows(joints),
        scale=100.0,
    )
