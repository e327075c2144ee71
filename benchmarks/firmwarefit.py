"""Fit the formula of a target's costs: cycles or instructions, flash and RAM, of random builds.

    python benchmarks/firmwarefit.py [TARGET ...]

Every build is compiled and run in simavr or qemu, on extreme and random frames. The coefficients, none negative, have
the least largest relative error; they are printed as they stand in the target's file.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.costs import NAME_BYTES, terms
from thenar.compiler.firmware.layout import arrange
from thenar.compiler.firmware.measuring import sizes
from thenar.compiler.firmware.probes import extreme_frames, joined, random_frames
from thenar.compiler.firmware.targets import TARGETS, Target
from thenar.compiler.firmware.words import numbered
from thenar.runtime.tables import COARSE, IntegerTables, Slope

FITTED = ("avr328p", "avr2560", "cortex-m0plus", "cortex-m4", "rv32imac")
FRAMES = 200
DRAWS = (*range(80), *range(1000, 1050))
TIME_TERMS = (
    *("one", "word classes", "byte classes", "passes", "class passes", "lookups", "kept lookups", "words", "entries"),
    *("offsets", "split words", "fields", "bins", "thresholds", "searches", "lines", "line sums"),
)
FLASH_TERMS = (
    *("one", "word classes", "byte classes", "passes", "class passes", "lookups", "kept lookups", "words"),
    *("split words", "found", "found words", "split code", "fields", "bins", "thresholds", "lines", "line sums"),
    *("rows", "padded rows", "tables"),
)
RAM_TERMS = (
    *("one", "word classes", "byte classes", "class passes", "found", "kept found", "sum words", "compared codes"),
    *("ports", "input"),
)


@dataclass(frozen=True, slots=True)
class Point:
    """The terms of a build, and its measured time, flash without names, and RAM."""

    terms: Mapping[str, float]
    time: int
    flash: int
    ram: int


def drawn(seed: int) -> IntegerTables:
    """Return random tables of a build such as compile makes: of bins or of lines, with narrow or wide rows."""
    random = np.random.default_rng(seed)
    classes, switches, joints = (int(random.integers(*ends)) for ends in ((3, 33), (4, 49), (1, 21)))
    alone = random.choice(["switches", "joints", "neither"], p=(0.25, 0.15, 0.6))
    switches, joints = switches * (alone != "joints"), joints * (alone != "switches")
    most, wide = int(random.choice([1, 25, 25, 300, 300])), random.random() < 0.2
    lines = int(random.integers(1, joints + 1)) if joints and random.random() < 0.25 else 0
    unit = COARSE if lines and random.random() < 0.5 else 1
    bins = int(random.integers(2, 20 if most > 1 else 8))
    last = np.arange(classes) < classes - (unit > 1)  # the others are relative to the last class

    def rows(*shape: int) -> NDArray[np.int16]:
        found: NDArray[np.int16] = random.integers(-most, most + 1, shape).astype(np.int16)
        return found if unit == 1 else (unit * np.sign(found) * last).astype(np.int16)

    def steps(joint: int) -> NDArray[np.uint16]:
        first = int(random.integers(0, 3000)) if wide else 0
        count = 0 if joint >= joints - lines else bins - 1
        return np.sort(random.choice(250, count, replace=False) + first).astype(np.uint16)

    thresholds = tuple(steps(joint) for joint in range(joints))
    slopes = tuple(
        Slope(joint, 3, 240, 0, (random.integers(-9, 10, classes) * last).astype(np.int8))
        for joint in range(joints - lines, joints)
    )
    return IntegerTables(
        bias=rows(classes),
        switch_rows=rows(switches, classes),
        thresholds=thresholds,
        joint_rows=tuple(rows(len(each) + 1, classes) for each in thresholds),
        switch_means=rows(switches, classes),
        joint_means=rows(joints, classes),
        scale=100.0,
        slopes=slopes,
        grid=unit,
    )


def runner(target: Target) -> Any:
    """Return the target if thenar runs and counts its code, otherwise its core in tests/qemu."""
    if target.kind:
        return target
    sys.path.append(str(Path(__file__).parents[1] / "tests" / "qemu"))
    return import_module("qemu").CORES[target.name]


def measured(name: str, tables: IntegerTables) -> Point | None:
    """Return a build's point on a target; None where it does not fit."""
    target, layout = TARGETS.named(name), arrange(tables)
    plain = numbered(tables)
    names = replace(plain, grasps=tuple(f"{grasp:.<{NAME_BYTES - 1}}" for grasp in plain.grasps))
    library = Library("glove", names, layout, target.avr)
    frames = joined(extreme_frames(tables), random_frames(tables, FRAMES, 1))
    sent = layout.frame_bytes(frames.bits, frames.codes)
    try:
        found = runner(target).run(library.files, "glove", layout, sent)
        flash, _, ram = sizes(library, target)
    except FirmwareError:
        return None
    return Point(terms(layout), found.most, flash - NAME_BYTES * (tables.n_classes + 1), ram)


def fitted(names: Sequence[str], points: Sequence[Point], values: Sequence[int]) -> dict[str, float]:
    """Return coefficients, 0 or more, of the least largest relative error."""
    matrix = np.array([[point.terms[name] for name in names] for point in points]) / np.array(values)[:, np.newaxis]
    n, k = matrix.shape
    cost = np.append(np.full(k, 1e-6), 1.0)
    ones = np.ones((n, 1))
    above, below = np.hstack([matrix, -ones]), np.hstack([-matrix, -ones])
    found = linprog(cost, np.vstack([above, below]), np.concatenate([np.ones(n), -np.ones(n)])).x
    assert found is not None
    return {name: float(f"{each:.4g}") for name, each in zip(names, found[:-1], strict=True) if each > 0.05}


def errors(coefficients: Mapping[str, float], points: Sequence[Point], values: Sequence[int]) -> NDArray[np.float64]:
    """Return the relative errors of a fit."""
    sums = np.array([sum(each * point.terms[name] for name, each in coefficients.items()) for point in points])
    return sums / np.array(values, np.float64) - 1


def main() -> None:
    """Print the formulas."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", default=FITTED, metavar="TARGET")
    asked = parser.parse_args()
    for name in asked.targets:
        with ProcessPoolExecutor(2) as pool:
            points = [point for point in pool.map(partial(measured, name), map(drawn, DRAWS)) if point]
        print(f"{name}: {len(points)} builds\nformula=Formula(")
        for part, names in (("time", TIME_TERMS), ("flash", FLASH_TERMS), ("ram", RAM_TERMS)):
            values = [getattr(point, part) for point in points]
            found = fitted(names, points, values)
            print(f"    {found},  # {100 * np.abs(errors(found, points, values)).max():.1f} % at most")
        print(")", flush=True)


if __name__ == "__main__":
    main()
