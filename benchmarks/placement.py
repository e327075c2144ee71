"""Fewer switches for the same recognition: thenar's placements and their rivals beside the paper's pruned ID3.

    python benchmarks/placement.py [SET.grasps ...] [--folds N] [--jobs N]

Each set is cut into stratified folds (Weka's, seed 1); placement and classifier (LogitBoost, 100 rounds) are learnt
from the training part alone, and rates are means over the folds. Without files the scenes kamakura and cutkosky are
simulated. S of the paper is 29 for 16 grasp types, else 62 where the set has so many rows a type, else 13. The smallest
placement is looked for by halving between sizes that recognise enough and sizes that do not, to STEP switches. Scan
times are wire times of whole scans: of a new glove of the kept switches alone, on MCP23017 at 400 kHz, and of the whole
glove's chips as wired, of which only the ports that hold kept switches are read (the methods named -cost know these).
"""

import argparse
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import winners
from thenar.compiler.evaluation.folds import Fold, weka_folds
from thenar.compiler.frontier.timing.wirings import port_costs
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.selection.learning import Columns, Learning
from thenar.compiler.selection.pairs import Pairs
from thenar.compiler.selection.rivals import available
from thenar.compiler.selection.subset import Subset, best_subset
from thenar.compiler.selection.ways import METHODS, Chooser, chooser
from thenar.compiler.workers import in_workers
from thenar.runtime.scanning.propose import propose_harness
from thenar.runtime.scanning.timing import scan_us
from thenar.runtime.scanning.whole import whole_scan
from thenar.simulator.running.simulation import simulate
from thenar.simulator.scenes.decode import load_scene

# Beside the joints, 33 switches are left out: that saves a fifth of the time.
SHOWN = {False: (8, 16, 33), True: (8, 16)}
MOST, STEP = 40, 2
FEW, BOUNDED = (2, 4, 8), "elimination"
ROUNDS, WITHIN, SEED = 100, 0.005, 1
PAPERS = "id3"
CONSOLE = Console(width=150)


@dataclass(frozen=True, slots=True, eq=False)
class Data:
    """A set, switches alone or with joints, its folds, and the S that the paper would take."""

    learning: Learning
    names: tuple[str, ...]
    folds: tuple[Fold, ...]
    prune: int

    @property
    def joints(self) -> bool:
        """Whether the joints are read too."""
        return bool(self.learning.codes.size)

    @property
    def shown(self) -> tuple[int, ...]:
        """Return the sizes whose rates are shown."""
        return SHOWN[self.joints]


@dataclass(frozen=True, slots=True)
class Point:
    """Means over the folds: recognition rate, number of switches, scan time of a new glove and as wired."""

    rate: float
    size: float
    new_us: float
    wired_us: float


@dataclass(frozen=True, slots=True)
class Line:
    """What one method reaches: at the sizes SHOWN, and with the fewest switches that recognise enough (None: none up to
    MOST, or not asked); processor seconds of choosing, for a fold.
    """

    method: str
    joints: bool
    shown: tuple[Point, ...]
    smallest: Point | None
    seconds: float


@dataclass(slots=True)
class Ways:
    """One method on all folds; what was measured is known."""

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
        self.chosen = [chooser(self.method, learning, ports) for learning in learnt]
        self.seconds = (process_time() - start) / len(self.data.folds)

    def pruned(self) -> Point:
        """Return what the paper's ID3 reaches under its S."""
        return self._mean([choose(self.data.prune) for choose in self.chosen])

    def at(self, most: int) -> Point:
        """Return what is reached with at most so many switches; ID3's S is the smallest that leaves no more."""
        if most not in self._known:
            self._known[most] = self._mean([self._kept(choose, most) for choose in self.chosen])
        return self._known[most]

    def smallest(self, wanted: float) -> Point | None:
        """Return the smallest placement found that recognises as much."""
        enough = next((size for size in (*self.data.shown, MOST) if self.at(size).rate >= wanted), None)
        if enough is None:
            return None
        short = max(size for size in (0, *self.data.shown) if size < enough)
        while enough - short > STEP:
            middle = (enough + short) // 2
            if self.at(middle).rate >= wanted:
                enough = middle
            else:
                short = middle
        return self.at(enough)

    def _kept(self, choose: Chooser, most: int) -> Columns:
        if METHODS[self.method].parameter == "switches":
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


def rate(learning: Learning, fold: Fold, columns: Columns) -> float:
    """Return the share of the test rows that LogitBoost recognises."""
    X = np.hstack([learning.switches[:, sorted(columns)].astype(np.uint16), learning.codes])
    stumps, _ = boost(X[fold.train], learning.labels[fold.train], learning.n_classes, rounds=ROUNDS)
    return float((winners(stumps.scores(X[fold.test])) == learning.labels[fold.test]).mean())


def measure(task: tuple[Data, str, float | None]) -> Line:
    """Return what one method reaches on a set, where a rate is wanted (None: rates at the sizes SHOWN alone)."""
    data, method, wanted = task
    ways = Ways(data, method)
    shown = tuple(ways.at(size) for size in data.shown)
    return Line(method, data.joints, shown, None if wanted is None else ways.smallest(wanted), ways.seconds)


def papers(data: Data) -> tuple[bool, Point]:
    """Return what the paper's placement reaches, and whether with joints."""
    return data.joints, Ways(data, PAPERS).pruned()


def bounded(task: tuple[Data, int]) -> tuple[int, int, Subset]:
    """Return m, the pairs alike in m switches that elimination keeps of all rows, and what bounded search says."""
    data, m = task
    columns = chooser(BOUNDED, data.learning)(m)
    return m, Pairs(data.learning).alike(columns), best_subset(data.learning, m, starts=(columns,))


def measured(alone: Data, with_joints: Data, paper: dict[bool, Point], jobs: int) -> list[Line]:
    """Return every method's line, switches alone first. Joints are no matter to rivals."""
    ours = [name for name, method in METHODS.items() if method.ours]
    wanted = {joints: point.rate - WITHIN for joints, point in paper.items()}
    # What takes longest begins first.
    tasks: list[tuple[Data, str, float | None]] = [
        (data, name, wanted[data.joints]) for data in (with_joints, alone) for name in reversed(ours)
    ]
    tasks += [(alone, name, None) for name in available()]
    lines = track(in_workers(measure, tasks, jobs), "methods", total=len(tasks), console=CONSOLE, transient=True)
    order = [*ours, *available()]
    return sorted(lines, key=lambda line: (line.joints, order.index(line.method)))


def saved(lines: Sequence[Line], joints: bool, paper: Point) -> Table:
    """Return the table of smallest placements within half a point of the paper's."""
    title = f"{kind(joints)}: fewest switches within {100 * WITHIN:g} points of the paper's"
    times = ("scan, new glove, us", "less", "as wired, us", "less")
    table = Table("method", "switches", "recognition, %", "fewer switches", *times, title=title)
    cells = (f"{paper.size:.1f}", f"{100 * paper.rate:.2f}", "", f"{paper.new_us:.0f}", "", f"{paper.wired_us:.0f}", "")
    table.add_row("the paper's pruned ID3", *cells, end_section=True)
    for line in lines:
        if line.joints != joints or not METHODS[line.method].ours:
            continue
        point = line.smallest
        if point is None:
            table.add_row(line.method, f"none up to {MOST}", f"{100 * line.shown[-1].rate:.2f} at {SHOWN[joints][-1]}")
            continue
        fewer = f"{1 - point.size / paper.size:.0%}"
        new = (f"{point.new_us:.0f}", f"{1 - point.new_us / paper.new_us:.0%}")
        wired = (f"{point.wired_us:.0f}", f"{1 - point.wired_us / paper.wired_us:.0%}")
        table.add_row(line.method, f"{point.size:.1f}", f"{100 * point.rate:.2f}", fewer, *new, *wired)
    return table


def compared(lines: Sequence[Line], joints: bool) -> Table:
    """Return the table of rates at given numbers of switches; numbers that a tree misses stand beside."""
    heads = (f"{size} switches, %" for size in SHOWN[joints])
    table = Table("method", *heads, "seconds to choose", title=kind(joints))
    for line in lines:
        if line.joints == joints:
            cells = (cell(point, size) for point, size in zip(line.shown, SHOWN[joints], strict=True))
            table.add_row(line.method, *cells, f"{line.seconds:.1f}")
    return table


def cell(point: Point, size: int) -> str:
    """Return a rate, with the mean number of switches if that is another."""
    return f"{100 * point.rate:.2f}" + ("" if point.size == size else f" ({point.size:.1f})")


def kind(joints: bool) -> str:
    """Return what is read, in words."""
    return "switches and joints" if joints else "switches alone"


def bounds(found: Sequence[tuple[int, int, Subset]]) -> Table:
    """Return the table of how far elimination is from the best subset of few switches, chosen from all rows."""
    heads = ("switches", f"{BOUNDED}, %", "best found, %", "none below, %", "at most from the best, points", "programs")
    table = Table(*heads, title="pairs of rows of different types that look alike, switches alone")
    for m, alike, best in sorted(found, key=lambda one: one[0]):
        shares = [100 * count / best.pairs for count in (alike, best.alike, best.least)]
        table.add_row(str(m), *(f"{share:.3f}" for share in shares), f"{shares[0] - shares[2]:.3f}", str(best.nodes))
    return table


def sets(paths: Sequence[Path]) -> dict[str, Callable[[], GraspSet]]:
    """Return what makes each set, by its name."""
    if paths:
        return {path.stem: lambda path=path: GraspSet.load(path) for path in paths}  # type: ignore[misc]
    return {name: lambda name=name: simulate(load_scene(name)).grasp_set for name in ("kamakura", "cutkosky")}  # type: ignore[misc]


def papers_prune(grasp_set: GraspSet) -> int:
    """Return the S that the paper would take."""
    types = len(np.unique(grasp_set.labels))
    if types == 16:
        return 29
    return 62 if len(grasp_set) >= 62 * types else 13


def datas(grasp_set: GraspSet, folds: int) -> tuple[Data, Data]:
    """Return the set with switches alone, and with joints."""
    types, labels = np.unique(grasp_set.labels, return_inverse=True)
    cut, prune = tuple(weka_folds(labels, folds, SEED)), papers_prune(grasp_set)
    alone, both = (
        Data(Learning(grasp_set.switches, codes, labels, len(types)), grasp_set.switch_names, cut, prune)
        for codes in (grasp_set.codes[:, :0], grasp_set.codes)
    )
    return alone, both


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", type=Path)
    parser.add_argument("--folds", type=int, default=4)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    for name, make in sets(options.sets).items():
        began, grasp_set = perf_counter(), make()
        alone, both = datas(grasp_set, options.folds)
        CONSOLE.rule(f"{name}: {len(grasp_set)} rows, {len(alone.names)} switches, S = {alone.prune}")
        paper = dict(in_workers(papers, (both, alone), options.jobs))
        lines = measured(alone, both, paper, options.jobs)
        for joints in (False, True):
            CONSOLE.print(saved(lines, joints, paper[joints]))
            CONSOLE.print(compared(lines, joints))
        CONSOLE.print(bounds(list(in_workers(bounded, [(alone, m) for m in FEW], options.jobs))))
        CONSOLE.print(f"{perf_counter() - began:.0f} s, {options.jobs} processes")


if __name__ == "__main__":
    main()
