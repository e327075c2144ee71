"""Fewer switches for the same recognition: thenar's placements and their rivals beside the paper's pruned ID3.

    python benchmarks/placement.py [SET.grasps ...] [--folds N] [--jobs N]

Each set is cut into stratified folds (Weka's, seed 1); placement and classifier are learnt from the training part
alone. Without files the scenes kamakura and cutkosky are simulated. S of the paper is 29 for 16 grasp types, else 62
where the set has so many rows a type, else 13. Scan time: wire time of a whole scan of a new glove of MCP23017.
"""

import argparse
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import winners
from thenar.compiler.evaluation.folds import Fold, weka_folds
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.selection.learning import Columns, Learning
from thenar.compiler.selection.rivals import available
from thenar.compiler.selection.ways import METHODS, chooser
from thenar.compiler.workers import in_workers
from thenar.runtime.scanning.propose import propose_harness
from thenar.runtime.scanning.timing import scan_us
from thenar.runtime.scanning.whole import whole_scan
from thenar.simulator.running.simulation import simulate
from thenar.simulator.scenes.decode import load_scene

SIZES = (4, 8, 12, 14, 16, 18, 20, 24, 28, 33, 40)
SHOWN = (8, 16, 33)
ROUNDS, WITHIN, SEED = 100, 0.005, 1
PAPERS = "id3"
CONSOLE = Console(width=140)


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """One method on one fold of a set, switches alone or with joints."""

    learning: Learning
    fold: Fold
    method: str
    prune: int

    @property
    def joints(self) -> bool:
        """Whether the joints are read too."""
        return bool(self.learning.codes.size)


@dataclass(frozen=True, slots=True)
class Line:
    """Rate and number of switches for every parameter of a method, and processor seconds for choosing."""

    method: str
    joints: bool
    rates: tuple[float, ...]
    sizes: tuple[float, ...]
    seconds: float


def scanned_us(count: float) -> float:
    """Return the wire time of a scan of so many switches, on as few chips as they need."""
    names = [f"s{number}" for number in range(round(count))]
    harness = propose_harness(names)
    return scan_us(whole_scan(harness, names), harness).us


def rate(learning: Learning, fold: Fold, columns: Columns) -> float:
    """Return the share of the test rows that LogitBoost recognises."""
    X = np.hstack([learning.switches[:, list(columns)].astype(np.uint16), learning.codes])
    stumps, _ = boost(X[fold.train], learning.labels[fold.train], learning.n_classes, rounds=ROUNDS)
    return float((winners(stumps.scores(X[fold.test])) == learning.labels[fold.test]).mean())


def measure(task: Task) -> Line:
    """Return the rates of one method on one fold."""
    start = process_time()
    choose = chooser(task.method, task.learning.rows(np.sort(task.fold.train)))
    seconds = process_time() - start
    parameters: Sequence[float] = (task.prune,) if METHODS[task.method].parameter == "S" else SIZES
    placements = [choose(parameter) for parameter in parameters]
    rates = tuple(rate(task.learning, task.fold, columns) for columns in placements)
    return Line(task.method, task.joints, rates, tuple(float(len(columns)) for columns in placements), seconds)


def mean(lines: Sequence[Line]) -> Line:
    """Return the mean over the folds of one method."""
    rates = np.mean([line.rates for line in lines], axis=0)
    sizes = np.mean([line.sizes for line in lines], axis=0)
    seconds = float(np.mean([line.seconds for line in lines]))
    return Line(lines[0].method, lines[0].joints, tuple(rates.tolist()), tuple(sizes.tolist()), seconds)


def measured(grasp_set: GraspSet, prune: int, folds: int, jobs: int) -> list[Line]:
    """Return every method's line, switches alone first; joints are no matter to rivals."""
    types, labels = np.unique(grasp_set.labels, return_inverse=True)
    ours = [name for name, method in METHODS.items() if method.ours]
    wanted = [(name, joints) for joints in (False, True) for name in ours]
    wanted += [(name, False) for name in available()]
    tasks = []
    for fold in weka_folds(labels, folds, SEED):
        for name, joints in wanted:
            codes = grasp_set.codes if joints else grasp_set.codes[:, :0]
            tasks.append(Task(Learning(grasp_set.switches, codes, labels, len(types)), fold, name, prune))
    found: dict[tuple[str, bool], list[Line]] = {key: [] for key in wanted}
    for line in track(in_workers(measure, tasks, jobs), "methods", total=len(tasks), console=CONSOLE, transient=True):
        found[line.method, line.joints].append(line)
    return [mean(sorted(lines, key=lambda line: line.rates)) for lines in found.values()]


def smallest(line: Line, wanted: float) -> int | None:
    """Return the place of the smallest placement that recognises as much as wanted."""
    return next((place for place, found in enumerate(line.rates) if found >= wanted), None)


def saved(lines: Sequence[Line], joints: bool) -> Table:
    """Return the table of smallest placements within half a point of the paper's."""
    paper = next(line for line in lines if line.method == PAPERS and line.joints == joints)
    title = f"{'switches + joints' if joints else 'switches alone'}: smallest within {100 * WITHIN:g} points of ID3"
    table = Table("method", "switches", "recognition, %", "fewer switches", "scan, us", "less scan", title=title)
    before = scanned_us(paper.sizes[0])
    table.add_row("id3 (the paper's)", f"{paper.sizes[0]:.1f}", f"{100 * paper.rates[0]:.2f}", "", f"{before:.0f}", "")
    for line in lines:
        if line.joints != joints or line.method == PAPERS:
            continue
        place = smallest(line, paper.rates[0] - WITHIN)
        if place is None:
            table.add_row(line.method, f"none up to {SIZES[-1]}", f"{100 * line.rates[-1]:.2f}")
            continue
        size, us = line.sizes[place], scanned_us(line.sizes[place])
        fewer, less = 1 - size / paper.sizes[0], 1 - us / before
        cells = (f"{size:.1f}", f"{100 * line.rates[place]:.2f}", f"{fewer:.0%}", f"{us:.0f}", f"{less:.0%}")
        table.add_row(line.method, *cells)
    return table


def compared(lines: Sequence[Line], joints: bool) -> Table:
    """Return the table of rates at given numbers of switches."""
    heads = (f"{size} switches, %" for size in SHOWN)
    table = Table("method", *heads, "seconds to choose", title="switches + joints" if joints else "switches alone")
    for line in lines:
        if line.joints == joints and line.method != PAPERS:
            rates = (f"{100 * line.rates[SIZES.index(size)]:.2f}" for size in SHOWN)
            table.add_row(line.method, *rates, f"{line.seconds:.1f}")
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


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", type=Path)
    parser.add_argument("--folds", type=int, default=4)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    for name, make in sets(options.sets).items():
        grasp_set = make()
        prune = papers_prune(grasp_set)
        CONSOLE.rule(f"{name}: {len(grasp_set)} rows, {len(grasp_set.switch_names)} switches, S = {prune}")
        lines = measured(grasp_set, prune, options.folds, options.jobs)
        for joints in (False, True):
            CONSOLE.print(saved(lines, joints))
            CONSOLE.print(compared(lines, joints))


if __name__ == "__main__":
    main()
