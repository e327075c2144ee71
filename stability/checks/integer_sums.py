"""Sums of int16 rows: their extremes, sums of the largest tables, and the winner of equal scores."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from thenar.runtime.build import Build
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Origin, Proof, Switch
from thenar.runtime.model.integers import (
    LIMIT,
    MAX_CLASSES,
    MAX_JOINTS,
    MAX_SWITCHES,
    IntegerTables,
    tables_from_bytes,
    tables_to_bytes,
)
from thenar.runtime.model.proof import furthest
from thenar.runtime.recipe import Recipe
from thenar.runtime.scores import LANE_OFFSET, Scorer

from ..finding import Finding, Worst
from ..inputs.hard_tables import every_frame, whole_numbers

_NO_DIGEST = "0" * 64


def bare_build(tables: IntegerTables) -> Build:
    """Return a build of `tables`, with numbers as names of grasp types, switches and joints."""
    n_inputs = tables.n_switches + tables.n_joints
    return Build(
        Manifest(
            schema=SCHEMA,
            checksum="",
            thenar="",
            tables_sha256=_NO_DIGEST,
            ensemble_sha256=_NO_DIGEST,
            source=Origin(_NO_DIGEST, 0, "none", tables.n_switches, joints=tables.n_joints),
            options=Recipe(0, 1, "both", 1.0, 0, 1),
            grasps=tuple(str(number) for number in range(tables.n_classes)),
            switches=tuple(Switch(number, str(number), 0.0) for number in range(tables.n_switches)),
            joints=tuple(Calibration(number, str(number), "deg", 0, 0.0, 1, 1.0) for number in range(tables.n_joints)),
            proof=Proof(16, tables.scale, tables.bound, (n_inputs + 1) / 2, n_inputs + 1, 0, 0),
            rates=(),
        ),
        tables,
    )


def largest_sum(inputs: Iterable[Sequence[Sequence[float]]]) -> float:
    """Return the largest magnitude of a class's sum of rows (K,), at most one per input, in any order of summation.

    It therefore also bounds all partial sums.
    """
    reached = 0.0
    for sign in (1, -1):
        tops = [[max(0, *(sign * step for step in column)) for column in zip(*rows, strict=True)] for rows in inputs]
        reached = max(reached, *(sum(column) for column in zip(*tops, strict=True)))
    return reached


def furthest_sums(seeds: range) -> Finding:
    """Check that the bound of the sums is attained but never exceeded, in all frames, whole and with missing inputs."""
    worst = Worst("furthest sum, and the frame and order that reach it", "every frame and every loss", 0, "steps")
    for seed in seeds:
        for most in (1, 90, 3000):
            tables = whole_numbers(seed, 3, 3, (3, 2), most)
            found, every = furthest(tables), _every_sum(tables)
            running = np.cumsum(found.terms[found.order, found.grasp].astype(np.int64))
            reached = int(running[found.n_terms - 1]) if found.n_terms else 0
            scored = Scorer(tables).lanes_without(found.bits, found.codes, found.lost_switches, found.lost_joints)
            for got, truth in (
                (tables.bound, every),
                (abs(found.total), every),
                (abs(reached), every),
                (int(np.abs(running).max()), every),
                (scored[found.grasp] - LANE_OFFSET, int(running[-1])),
            ):
                worst.see(abs(got - truth), f"draw {seed}, rows up to {most}")
    return worst.finding()


def largest(full: bool) -> Finding:
    """Compare the scores of the largest tables with 64-bit sums."""
    worst = Worst("scores by the largest tables that fit in a file", "sums of 64 bits", 0, "scores")
    random = np.random.default_rng(7)
    sizes: list[tuple[int, int, tuple[int, ...]]] = [
        (2, MAX_SWITCHES, ()),
        (2, 0, (65536,)),
        (MAX_CLASSES, 0, (31,) * 250),
        (2, MAX_SWITCHES, (6,) * MAX_JOINTS),
    ]
    if full:
        sizes.append((MAX_CLASSES, MAX_SWITCHES - 1, ()))
    for classes, switches, bins in sizes:
        tables = tables_from_bytes(tables_to_bytes(_filled(whole_numbers(7, classes, switches, bins, 6))))
        bits = random.random(switches) < 0.5
        codes = random.integers(0, 65536, len(bins)).astype(np.uint16)
        rows = [tables.bias.astype(np.int64), tables.switch_rows[bits].sum(axis=0, dtype=np.int64)]
        joints = zip(tables.thresholds, tables.joint_rows, codes, strict=True)
        rows += [steps[np.searchsorted(thresholds, code)].astype(np.int64) for thresholds, steps, code in joints]
        scores = np.array(Scorer(tables).lanes(bits, codes)) - LANE_OFFSET
        differ = int(np.count_nonzero(scores != np.sum(rows, axis=0))) + int(tables.bound != LIMIT)
        worst.see(differ, f"{classes} classes, {switches} switches, {sum(bins)} bins", classes)
    return worst.finding()


def _filled(tables: IntegerTables) -> IntegerTables:
    """Return the tables with a bias for which the furthest of all sums is 32767."""
    silent = replace(tables, bias=0 * tables.bias)
    found = furthest(silent)
    bias = tables.bias * 0
    bias[found.grasp] = np.sign(found.total) * (LIMIT - abs(found.total))
    return replace(tables, bias=bias)


def _every_sum(tables: IntegerTables) -> int:
    """Return the largest magnitude of any frame's partial sums, whole or with missing inputs, in the worst order."""
    choices = [[tables.bias.tolist()]]
    switches = zip(tables.switch_rows.tolist(), tables.switch_means.tolist(), strict=True)
    choices += [[[0] * tables.n_classes, row, mean] for row, mean in switches]
    joints = zip(tables.joint_rows, tables.joint_means.tolist(), strict=True)
    choices += [[*rows.tolist(), mean] for rows, mean in joints]
    furthest_of_all = 0
    for terms in product(*choices):
        for column in zip(*terms, strict=True):
            onward = sum(value for value in column if value > 0)
            furthest_of_all = max(furthest_of_all, onward, onward - sum(column))
    return furthest_of_all


def ties(full: bool) -> Finding:
    """Check that of equal scores the first wins, as in C, which replaces the best only by a greater score."""
    worst = Worst("equal best scores", "the first of them", 0, "frames")
    for seed in range(30 if full else 3):
        tables = whole_numbers(seed, 5, 4, (3, 3), 1)
        build = bare_build(tables)
        for frame in every_frame(tables):
            bits, codes = np.array(frame.bits), np.array(frame.codes, np.uint16)
            scores = build.scores(bits, codes).tolist()
            best = first_best(scores)
            if scores.count(scores[best]) < 2:
                continue
            found = build.recognise(bits, codes)
            right = build.classify(bits, codes) == found.grasp == str(best) and found.margin == 0
            worst.see(float(not right), f"draw {seed}: {frame}")
    return worst.finding()


def first_best(scores: Sequence[int]) -> int:
    """Return the index of the greatest score, of equal ones the first, written as in C."""
    best = 0
    for k in range(1, len(scores)):
        if scores[k] > scores[best]:
            best = k
    return best
