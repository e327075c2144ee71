"""Fewer switches for the same accuracy: thenar's placements and baselines compared with the paper's pruned ID3.

    python benchmarks/placement.py [SET.grasps ...] [--folds N] [--jobs N]

Each set is cut into stratified folds (Weka's, seed 1); placement and classifier (LogitBoost, 100 rounds) are trained on
the training part only, and rates are means over the folds. Without files the scenes kamakura and cutkosky are
simulated. The paper's S is 29 for 16 grasp types, else 62 if the set has that many rows per type, else 13. The smallest
placement is found by bisection between sizes that are accurate enough and sizes that are not. Scan times are wire times
of whole scans: of a new glove with only the kept switches, on MCP23017 at 400 kHz, and of the whole glove's chips as
wired, reading only the ports with kept switches (the methods named -cost take these into account).
"""

import argparse
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from placementlines import CONSOLE, Data, measured, papers
from placementtables import compared, saved

from thenar.compiler.evaluation.folds import weka_folds
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.workers import in_workers
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import simulate

SEED = 1


def sets(paths: Sequence[Path]) -> dict[str, Callable[[], GraspSet]]:
    """Return a function that creates each set, by its name."""
    if paths:
        return {path.stem: lambda path=path: GraspSet.load(path) for path in paths}  # type: ignore[misc]
    return {name: lambda name=name: simulate(load_scene(name)).grasp_set for name in ("kamakura", "cutkosky")}  # type: ignore[misc]


def papers_prune(grasp_set: GraspSet) -> int:
    """Return the S that the paper would choose."""
    types = len(np.unique(grasp_set.labels))
    if types == 16:
        return 29
    return 62 if len(grasp_set) >= 62 * types else 13


def inputs(grasp_set: GraspSet, folds: int) -> tuple[Data, Data]:
    """Return the set with switches only, and with joints."""
    samples = Samples.of(grasp_set, "switches"), Samples.of(grasp_set)
    cut, prune = tuple(weka_folds(samples[0].labels, folds, SEED)), papers_prune(grasp_set)
    alone, both = (Data(part, grasp_set.switch_names, cut, prune) for part in samples)
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
        alone, both = inputs(grasp_set, options.folds)
        CONSOLE.rule(f"{name}: {len(grasp_set)} rows, {len(alone.names)} switches, S = {alone.prune}")
        paper = dict(in_workers(papers, (both, alone), options.jobs))
        lines = measured(alone, both, paper, options.jobs)
        for joints in (False, True):
            CONSOLE.print(saved(lines, joints, paper[joints]))
            CONSOLE.print(compared(lines, joints))
        CONSOLE.print(f"{perf_counter() - began:.0f} s, {options.jobs} processes")


if __name__ == "__main__":
    main()
