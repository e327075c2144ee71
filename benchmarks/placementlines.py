"""The results of each placement on a set: at given numbers of switches, and with the fewest that suffice."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import process_time

import numpy as np
from rich.console import Console
from rich.progress import track

from thenar.compiler.evaluation.folds import Fold
from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.placement.methods.base import METHODS, PAPERS, Chooser
from thenar.compiler.placement.ports import port_costs
from thenar.compiler.samples import Columns, Samples
from thenar.compiler.trainers.logitboost import boost
from thenar.compiler.workers import in_workers
from thenar.runtime.model.tables import winners
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us

# With joints, the size of 33 switches is left out, which saves a fifth of the time.
SHOWN = {False: (8, 16, 33), True: (8, 16)}
MOST, WITHIN, ROUNDS = 40, 0.005, 100
CONSOLE = Console(width=150)


@dataclass(frozen=True, slots=True, eq=False)
class Data:
    """A set, with switches only or with joints, its folds, and the S that the paper would choose."""

    learning: Samples
    names: tuple[str, ...]
    folds: tuple[Fold, ...]
    prune: int

    @property
    def joints(self) -> bool:
        """Whether the joints are read too."""
        return bool(self.learning.codes.size)

    @property
    def shown(self) -> tuple[int, ...]:
        """Return the sizes in the table."""
        return SHOWN[self.joints]


@dataclass(frozen=True, slots=True)
class Point:
    """Means over the folds: accuracy, number of switches, scan time of a new glove and as wired."""

    rate: float
    size: float
    new_us: float
    wired_us: float


@dataclass(frozen=True, slots=True)
class Line:
    """The results of one method: at the sizes SHOWN, and with the fewest switches that are accurate enough (None: none
    up to MOST, or not requested); processor seconds of choosing, per fold.
    """

    method: str
    joints: bool
    shown: tuple[Point, ...]
    smallest: Point | None
    seconds: float


@dataclass(slots=True)
class Ways:
    """One method on all folds, with a cache of its measurements."""

    data: Data
    method: str
    chosen: list[Chooser] = field(init=False)
    seconds: float = field(init=False)
    _known: dict[int, Point] = field(default_factory=dict)
    _rates: dict[tuple[int, frozenset[int]], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = self.data.names
        ports = port_costs(propose_harness(names), names)
        start = process_time()
        learnt = (self.data.learning.rows(np.sort(fold.train)) for fold in self.data.folds)
        self.chosen = [METHODS[self.method].chooser(learning, ports) for learning in learnt]
        self.seconds = (process_time() - start) / len(self.data.folds)

    def pruned(self) -> Point:
        """Return the result of the paper's ID3 with its S."""
        return self._mean([choose(self.data.prune) for choose in self.chosen])

    def at(self, most: int) -> Point:
        """Return the result with at most `most` switches; ID3's S is the smallest that leaves no more."""
        if most not in self._known:
            self._known[most] = self._mean([self._kept(choose, most) for choose in self.chosen])
        return self._known[most]

    def smallest(self, wanted: float) -> Point | None:
        """Return the smallest placement found with at least this accuracy."""
        enough = next((size for size in (*self.data.shown, MOST) if self.at(size).rate >= wanted), None)
        if enough is None:
            return None
        short = max(size for size in (0, *self.data.shown) if size < enough)
        while enough - short > 1:
            middle = (enough + short) // 2
            if self.at(middle).rate >= wanted:
                enough = middle
            else:
                short = middle
        return self.at(enough)

    def _kept(self, choose: Chooser, most: int) -> Columns:
        if METHODS[self.method].by_number:
            return choose(most)
        low, high = 0, len(self.data.learning.labels) + 1
        while low < high:
            middle = (low + high) // 2
            low, high = (low, middle) if len(choose(middle)) <= most else (middle + 1, high)
        return choose(low)

    def _mean(self, placements: Sequence[Columns]) -> Point:
        harness = propose_harness(self.data.names)
        found = []
        for number, columns in enumerate(placements):
            names = [self.data.names[column] for column in columns]
            new = propose_harness(names)
            new_us, wired_us = (scan_us(whole_scan(one, names), one).us for one in (new, harness))
            found.append((self._rate(number, columns), len(columns), new_us, wired_us))
        return Point(*np.mean(found, axis=0).tolist())

    def _rate(self, number: int, columns: Columns) -> float:
        key = (number, frozenset(columns))
        if key not in self._rates:
            self._rates[key] = rate(self.data.learning, self.data.folds[number], columns)
        return self._rates[key]


def rate(learning: Samples, fold: Fold, columns: Columns) -> float:
    """Return LogitBoost's accuracy on the test rows."""
    X = np.hstack([learning.switches[:, sorted(columns)].astype(np.uint16), learning.codes])
    stumps, _ = boost(X[fold.train], learning.labels[fold.train], learning.n_classes, rounds=ROUNDS)
    return float((winners(stumps.scores(X[fold.test])) == learning.labels[fold.test]).mean())


def measure(task: tuple[Data, str, float | None]) -> Line:
    """Return the results of one method on a set, given the wanted accuracy (None: only rates at the sizes SHOWN)."""
    data, method, wanted = task
    ways = Ways(data, method)
    shown = tuple(ways.at(size) for size in data.shown)
    return Line(method, data.joints, shown, None if wanted is None else ways.smallest(wanted), ways.seconds)


def papers(data: Data) -> tuple[bool, Point]:
    """Return the result of the paper's placement, and whether it is with joints."""
    return data.joints, Ways(data, PAPERS).pruned()


def measured(alone: Data, with_joints: Data, paper: dict[bool, Point], jobs: int) -> list[Line]:
    """Return every method's line, switches only first. Joints do not matter to baselines."""
    ours = [name for name, method in METHODS.items() if method.ours]
    baselines = [name for name, method in METHODS.items() if not method.ours]
    wanted = {joints: point.rate - WITHIN for joints, point in paper.items()}
    # The longest tasks start first.
    tasks: list[tuple[Data, str, float | None]] = [
        (data, name, wanted[data.joints]) for data in (with_joints, alone) for name in reversed(ours)
    ]
    tasks += [(alone, name, None) for name in baselines]
    lines = track(in_workers(measure, tasks, jobs), "methods", total=len(tasks), console=CONSOLE, transient=True)
    order = [*ours, *baselines]
    return sorted(lines, key=lambda line: (line.joints, order.index(line.method)))
