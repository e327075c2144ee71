"""Fewer switches for the same accuracy: thenar's placements and baselines compared with the paper's pruned ID3.

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
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from placementlines import CONSOLE, MOST, SHOWN, WITHIN, Data, Line, Point, measured, papers
from rich.table import Table

from thenar.compiler.evaluation.folds import weka_folds
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.workers import in_workers

FOLDS, SEED = 4, 1


def papers_prune(grasp_set: GraspSet) -> int:
    """Return the S that the paper would choose."""
    types = len(np.unique(grasp_set.labels))
    if types == 16:
        return 29
    return 62 if len(grasp_set) >= 62 * types else 13


def saved(lines: Sequence[Line], joints: bool, paper: Point) -> Table:
    """Return the table of smallest placements within half a point of the paper's accuracy."""
    title = f"{kind(joints)}: fewest switches within {100 * WITHIN:g} points of the paper's"
    times = ("scan, new glove, µs", "less", "as wired, µs", "less")
    table = Table("method", "switches", "accuracy, %", "fewer switches", *times, title=title)
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
    """Return the table of rates at given numbers of switches; numbers that a tree misses are added in brackets."""
    heads = (f"{size} switches, %" for size in SHOWN[joints])
    table = Table("method", *heads, "seconds to choose", title=kind(joints))
    for line in lines:
        if line.joints == joints:
            cells = (cell(point, size) for point, size in zip(line.shown, SHOWN[joints], strict=True))
            table.add_row(line.method, *cells, f"{line.seconds:.1f}")
    return table


def cell(point: Point, size: int) -> str:
    """Return a rate, with the mean number of switches if it differs from `size`."""
    return f"{100 * point.rate:.2f}" + ("" if point.size == size else f" ({point.size:.1f})")


def kind(joints: bool) -> str:
    """Return the inputs, in words."""
    return "switches and joints" if joints else "switches only"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="+", type=Path)
    options, jobs = parser.parse_args(), os.cpu_count() or 1
    for path in options.sets:
        began, grasp_set = perf_counter(), GraspSet.load(path)
        samples = Samples.of(grasp_set, "switches"), Samples.of(grasp_set)
        cut, prune = tuple(weka_folds(samples[0].labels, FOLDS, SEED)), papers_prune(grasp_set)
        alone, both = (Data(part, grasp_set.switch_names, cut, prune) for part in samples)
        CONSOLE.rule(f"{path.stem}: {len(grasp_set)} rows, {len(alone.names)} switches, S = {alone.prune}")
        paper = dict(in_workers(papers, (both, alone), jobs))
        lines = measured(alone, both, paper, jobs)
        for joints in (False, True):
            CONSOLE.print(saved(lines, joints, paper[joints]))
            CONSOLE.print(compared(lines, joints))
        CONSOLE.print(f"{perf_counter() - began:.0f} s, {jobs} processes")


if __name__ == "__main__":
    main()
