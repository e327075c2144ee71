"""Fewer switches for the same accuracy: thenar's placements compared with the paper's pruned ID3.

    python benchmarks/placement.py SET.grasps ...

Each set is cut into stratified folds (Weka's, seed 1); placement and classifier (LogitBoost, 100 rounds) are trained on
the training part only, and rates are means over the folds. The paper's S is 29 for 16 grasp types, else 62 if the set
has that many rows per type, else 13. The smallest placement is found by bisection between sizes that are accurate
enough and sizes that are not. Scan times are wire times of whole scans: of a new glove with only the kept switches, on
MCP23017 at 400 kHz, and of the whole glove's chips as wired, reading only the ports with kept switches (the methods
named -cost take these into account).
"""

import argparse
import os
from bisect import bisect_left
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from thenar.compiler.evaluation.folds import weka_folds
from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.placement.methods.base import METHODS, PAPERS, Chooser
from thenar.compiler.placement.ports import port_costs
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Columns, Samples
from thenar.compiler.trainers.logitboost import boost
from thenar.compiler.workers import in_workers
from thenar.runtime.model.tables import winners
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us

FOLDS, SEED = 4, 1
MOST, WITHIN, ROUNDS = 40, 0.005, 100
# Sizes tried before the bisection, without joints and with them: accuracy does not grow with every switch.
TRIED = {False: (8, 16, 33, MOST), True: (8, 16, MOST)}
CONSOLE = Console(width=150)


class Point(NamedTuple):
    """Means over the folds: accuracy, number of switches, scan time of a new glove and as wired."""

    rate: float
    size: float
    new_us: float
    wired_us: float


class Placements:
    """The placements of one method in all folds of a set, and their results."""

    def __init__(self, samples: Samples, names: Sequence[str], method: str) -> None:
        self._samples, self._names, self._method = samples, names, METHODS[method]
        self._harness = propose_harness(names)
        self._folds = weka_folds(samples.labels, FOLDS, SEED)
        ports = port_costs(self._harness, names)
        self._choosers = [self._method.chooser(samples.rows(np.sort(fold.train)), ports) for fold in self._folds]
        self._known: dict[int, Point] = {}

    def pruned(self, prune: int) -> Point:
        """Return the result of ID3 with the paper's S."""
        return self._mean([choose(prune) for choose in self._choosers])

    def at(self, most: int) -> Point:
        """Return the result with at most `most` switches; ID3's S is the smallest that leaves no more."""
        if most not in self._known:
            self._known[most] = self._mean([self._kept(choose, most) for choose in self._choosers])
        return self._known[most]

    def smallest(self, wanted: float) -> Point | None:
        """Return the smallest placement found with at least this accuracy; None if none up to MOST has it."""
        tried = TRIED[bool(self._samples.codes.size)]
        enough = next((size for size in tried if self.at(size).rate >= wanted), None)
        if enough is None:
            return None
        short = max(size for size in (0, *tried) if size < enough)
        while enough - short > 1:
            middle = (enough + short) // 2
            if self.at(middle).rate >= wanted:
                enough = middle
            else:
                short = middle
        return self.at(enough)

    def _kept(self, choose: Chooser, most: int) -> Columns:
        if self._method.by_number:
            return choose(most)
        parameters = range(len(self._samples.labels) + 1)
        return choose(bisect_left(parameters, True, key=lambda S: len(choose(S)) <= most))

    def _mean(self, placements: Sequence[Columns]) -> Point:
        found = []
        for fold, columns in zip(self._folds, placements, strict=True):
            X = np.hstack([self._samples.switches[:, sorted(columns)].astype(np.uint16), self._samples.codes])
            labels = self._samples.labels
            stumps, _ = boost(X[fold.train], labels[fold.train], self._samples.n_classes, rounds=ROUNDS)
            rate = (winners(stumps.scores(X[fold.test])) == labels[fold.test]).mean()
            names = [self._names[column] for column in columns]
            gloves = (propose_harness(names), self._harness)
            found.append((rate, len(columns), *(scan_us(whole_scan(one, names), one).us for one in gloves)))
        return Point(*np.mean(found, axis=0).tolist())


def papers_prune(grasp_set: GraspSet) -> int:
    """Return the S that the paper would choose."""
    types = len(np.unique(grasp_set.labels))
    if types == 16:
        return 29
    return 62 if len(grasp_set) >= 62 * types else 13


def measured(task: tuple[Samples, Sequence[str], str, float]) -> tuple[str, Point | None]:
    """Return a method, and its smallest placement with the wanted accuracy."""
    samples, names, method, wanted = task
    return method, Placements(samples, names, method).smallest(wanted)


def row(method: str, point: Point, paper: Point) -> tuple[str, ...]:
    """Return the row of a placement: what it saves of the paper's."""
    pairs = zip((point.new_us, point.wired_us), (paper.new_us, paper.wired_us), strict=True)
    times = (cell for own, other in pairs for cell in (f"{own:.0f}", f"{1 - own / other:.0%}"))
    return method, f"{point.size:.1f}", f"{100 * point.rate:.2f}", f"{1 - point.size / paper.size:.0%}", *times


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="+", type=Path)
    ours = [name for name, method in METHODS.items() if method.ours]
    for path in parser.parse_args().sets:
        grasp_set = GraspSet.load(path)
        names, prune = grasp_set.switch_names, papers_prune(grasp_set)
        CONSOLE.rule(f"{path.stem}: {len(grasp_set)} rows, {len(names)} switches, S = {prune}")
        for what, samples in (
            ("switches only", Samples.of(grasp_set, "switches")),
            ("switches and joints", Samples.of(grasp_set)),
        ):
            paper = Placements(samples, names, PAPERS).pruned(prune)
            tasks = [(samples, names, method, paper.rate - WITHIN) for method in ours]
            work = in_workers(measured, tasks, os.cpu_count() or 1)
            lines = track(work, "methods", total=len(tasks), console=CONSOLE, transient=True)
            table = Table(title=f"{what}: fewest switches within {100 * WITHIN:g} points of the paper's")
            times = ("scan, new glove, µs", "less", "as wired, µs", "less")
            for heading in ("method", "switches", "accuracy, %", "fewer switches", *times):
                table.add_column(heading)
            table.add_row(*row("the paper's pruned ID3", paper, paper), end_section=True)
            for method, smallest in sorted(lines, key=lambda line: ours.index(line[0])):
                cells = (method, f"none up to {MOST}") if smallest is None else row(method, smallest, paper)
                table.add_row(*cells)
            CONSOLE.print(table)


if __name__ == "__main__":
    main()
