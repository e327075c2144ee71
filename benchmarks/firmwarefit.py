"""Fit the formula of a target's costs: cycles or instructions of random builds; and the flash and RAM of the core.

    python benchmarks/firmwarefit.py [TARGET ...]

Every build is compiled and run in simavr or qemu, on extreme and random frames. The coefficients, none negative, have
the least largest relative error; they are printed as they stand in the target's file. The core has the same bytes of
flash and RAM in every build, but for a few that the compiler aligns.
"""

import argparse
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from firmwarerun import CORES
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.optimize import linprog

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.costs import NAME_BYTES, estimate, sizes, table_bytes, terms
from thenar.compiler.firmware.layout import GROUPS, Layout
from thenar.compiler.firmware.probes import extreme_frames, joined, random_frames
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.base import Formula
from thenar.compiler.firmware.words import numbered
from thenar.runtime.model.integers import COARSE, IntegerTables
from thenar.runtime.model.quantise import in_bytes
from thenar.runtime.model.terms.line import Line

FITTED = ("avr328p", "cortex-m0plus", "cortex-m4", "rv32imac")
FRAMES = 200
DRAWS = range(60)


@dataclass(frozen=True, slots=True)
class Point:
    """A build, the terms of its time, and its measured time, flash without names, and RAM."""

    layout: Layout
    terms: Mapping[str, int]
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
    gain = int(random.integers(-4, 4))
    span = 240 >> gain if gain > 0 else 240 << -gain
    slopes = tuple(
        Line(joint, 3, 3 + span, (random.integers(-9, 10, classes) * last).astype(np.int8), gain)
        for joint in range(joints - lines, joints)
    )
    return IntegerTables.of(
        bias=rows(classes),
        switch_rows=rows(switches, classes),
        thresholds=thresholds,
        joint_rows=tuple(rows(len(each) + 1, classes) for each in thresholds),
        switch_means=rows(switches, classes),
        joint_means=rows(joints, classes),
        scale=100.0,
        further=slopes,
        grid=unit,
    )


def measured(name: str, seed: int) -> Point | None:
    """Return the point of a drawn build on a target; None where it does not fit."""
    target, tables = TARGETS.named(name), in_bytes(drawn(seed))
    layout = Layout(tables, GROUPS[seed % len(GROUPS)])
    plain = numbered(tables)
    names = replace(plain, grasps=tuple(f"{grasp:.<{NAME_BYTES - 1}}" for grasp in plain.grasps))
    library = Library("glove", names, layout)
    frames = joined(extreme_frames(tables), random_frames(tables, FRAMES, 1))
    sent = layout.frame_bytes(frames.bits, frames.codes)
    try:
        # thenar itself runs targets of a kind alone.
        found = (target if target.kind else CORES[name]).run(library.files, "glove", layout, sent)
        flash, ram = sizes(library, target)
    except FirmwareError:
        return None
    return Point(layout, terms(layout, avr=target.avr), found.most, flash - NAME_BYTES * tables.n_classes, ram)


def fitted(points: Sequence[Point], values: Sequence[int]) -> tuple[float, ...]:
    """Return coefficients, 0 or more, of the least largest relative error."""
    matrix = np.array([[*point.terms.values()] for point in points]) / np.array(values)[:, np.newaxis]
    n, k = matrix.shape
    cost = np.append(np.full(k, 1e-6), 1.0)
    ones = np.ones((n, 1))
    above, below = np.hstack([matrix, -ones]), np.hstack([-matrix, -ones])
    found = linprog(cost, np.vstack([above, below]), np.concatenate([np.ones(n), -np.ones(n)])).x
    assert found is not None
    return tuple(float(f"{each:.4g}") for each in found[:-1])


def errors(formula: Formula, points: Sequence[Point], *, avr: bool) -> dict[str, NDArray[np.float64]]:
    """Return the relative errors of time, flash and RAM."""
    costs = [estimate(formula, point.layout, avr=avr) for point in points]
    names = [NAME_BYTES * point.layout.tables.n_classes for point in points]
    pairs = {
        "time": [(cost.cycles, point.time) for cost, point in zip(costs, points, strict=True)],
        "flash": [(cost.flash - n, point.flash) for cost, point, n in zip(costs, points, names, strict=True)],
        "ram": [(cost.ram, point.ram) for cost, point in zip(costs, points, strict=True)],
    }
    return {part: np.divide(*np.array(each, np.float64).T) - 1 for part, each in pairs.items()}


def main() -> None:
    """Print the formulas."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", default=FITTED, metavar="TARGET")
    asked = parser.parse_args()
    for name in asked.targets:
        avr = TARGETS.named(name).avr
        with ProcessPoolExecutor(2) as pool:
            points = [point for point in pool.map(partial(measured, name), DRAWS) if point]
        tables = np.array([table_bytes(point.layout, avr=avr) for point in points])
        flash = np.array([point.flash for point in points]) - tables
        ram = np.array([point.ram - 2 * point.layout.memory for point in points])
        cycles = fitted(points, [point.time for point in points])
        formula = Formula(cycles, int(np.median(flash)), int(np.median(ram)))
        print(f"{name}: {len(points)} builds; flash {flash.min()} to {flash.max()}, RAM {ram.min()} to {ram.max()}")
        print(f"formula={formula},", flush=True)
        for part, found in errors(formula, points, avr=avr).items():
            print(f"    # {part}: {100 * np.abs(found).max():.1f} % at most", flush=True)


if __name__ == "__main__":
    main()
