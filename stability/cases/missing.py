"""Ports that do not reply and joints that stop sending; rows fitted to the training rows replace them."""

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.tables.furthest import furthest
from thenar.runtime.build import Build
from thenar.runtime.scores import LANE_OFFSET
from thenar.runtime.tables import HIGHEST_CODE, IntegerTables

from ..checks.integer_sums import first_best
from ..finding import Case, Finding, Worst
from ..inputs.hard_tables import Bits, Codes
from ..inputs.small_sets import SmallBuild, small_build, small_set
from ..reference.numbers import precisely
from ..reference.standing_in import Kind, stand_ins
from ..reference.tables import balanced, mean_row, mean_switch


def changes(tables: IntegerTables, sign: int) -> list[NDArray[np.int64]]:
    """Return per input, times `sign`, the replacement row minus the row of each value, (values, K) steps."""
    pairs = [
        (np.stack([0 * row, row]), mean) for row, mean in zip(tables.switch_rows, tables.switch_means, strict=True)
    ]
    pairs += zip(tables.joint_rows, tables.joint_means, strict=True)
    return [sign * (mean.astype(np.int64) - rows) for rows, mean in pairs]


def worst_frames(tables: IntegerTables) -> Iterator[tuple[Bits, Codes]]:
    """Yield the frames in which a loss changes a score most, and those whose sums get furthest from zero.

    Inputs are independent, so for a class and a direction the first are the same for every loss. Codes are the lowest,
    then the highest, of their bins.
    """
    for sign in (1, -1):
        most = [change.argmax(axis=0) for change in changes(tables, sign)]
        for grasp in range(tables.n_classes):
            picked = [int(of_input[grasp]) for of_input in most]
            bits, bins = np.array(picked[: tables.n_switches], bool), picked[tables.n_switches :]
            ends = [(0, *(steps.astype(int) + 1), *steps, HIGHEST_CODE) for steps in tables.thresholds]
            for end in (0, 1):
                codes = [of[b + end * len(of) // 2] for of, b in zip(ends, bins, strict=True)]
                yield bits, np.array(codes, np.uint16)
    for missing in (True, False):
        found = furthest(tables, missing=missing)
        yield found.bits, found.codes


CASE = Case(
    title="Missing ports and silent joints",
    danger="with a fitted row for a missing input a score changes more than proven, or the loss is not reported",
)

_SUBSETS = "every subset of ports and joints"


class Lost(NamedTuple):
    """What is lost, switches (s,) and joints (j,), and n frames: bits (n, s), codes (n, j), scores (n, K) under it."""

    name: str
    switches: Bits
    joints: Bits
    bits: Bits
    codes: Codes
    scores: NDArray[np.int64]

    @property
    def inputs(self) -> Bits:
        """Switches, then joints."""
        return np.concatenate([self.switches, self.joints])


def findings(full: bool) -> Iterator[Finding]:
    """Lose every subset of joints and of ports, of 8 and of 16 switches, in recorded and in the worst frames."""
    if full:
        small = small_build(small_set(8, rows=150, switches=48, joints=4, types=5, noise=0.15), rounds=40)
    else:
        small = small_build(small_set(8, rows=100, switches=32, joints=2, types=4, noise=0.1), rounds=20)
    recorded = 24 if full else 8
    hard = list(worst_frames(small.build.tables))
    bits = np.vstack([small.bits[:recorded], *(of_frame for of_frame, _ in hard)])
    codes = np.vstack([small.codes[:recorded], *(of_frame for _, of_frame in hard)])
    cases = [case for width in (8, 16) for case in every_loss(small.build, width, bits, codes)]
    yield _fitted(small)
    yield _integers(small, cases)
    yield _sums(small, cases)
    yield from _reported(small, cases)


def every_loss(build: Build, width: int, bits: Bits, codes: Codes) -> Iterator[Lost]:
    """Yield every subset of ports, `width` switches each in the order of their columns, and joints.

    The last port has no kept switch.
    """
    ports = np.array([switch.column // width for switch in build.manifest.switches])
    n_ports, n_joints = int(ports.max()) + 2, build.tables.n_joints
    for silent in product((False, True), repeat=n_ports + n_joints):
        masks = np.array(silent)
        name = f"silent of {n_ports} ports {np.flatnonzero(masks[:n_ports])}, joints {np.flatnonzero(masks[n_ports:])}"
        lost = masks[:n_ports][ports], masks[n_ports:]
        lanes = [build.scorer.lanes_without(*frame, *lost) for frame in zip(bits, codes, strict=True)]
        yield Lost(name, *lost, bits, codes, np.array(lanes) - LANE_OFFSET)


def _fitted(small: SmallBuild) -> Finding:
    """Compare the replacement of each input with the same fit at 60 digits, whose numbers are integers as well."""
    worst = Worst("the replacement of each input", "the fit at 60 digits", 0, "steps")
    tables, integers = small.tables, small.build.tables
    _, joint_rows = balanced(tables.bias.tolist(), [rows.tolist() for rows in tables.joint_rows])
    of_switches = zip(tables.switch_rows.tolist(), small.bits.T.tolist(), strict=True)
    of_joints = zip(map(np.ndarray.tolist, tables.thresholds), joint_rows, small.codes.T.tolist(), strict=True)
    means = [mean_switch(row, bits) for row, bits in of_switches], [mean_row(*joint) for joint in of_joints]
    got = integers.switch_means.tolist(), integers.joint_means.tolist()
    for what, kind, of_kind, rows in zip(("switch", "joint"), _kinds(small), means, got, strict=True):
        with precisely():
            in_steps = [[value * integers.scale for value in row] for row in of_kind]
        for number, (one, other) in enumerate(zip(stand_ins(kind, in_steps), rows, strict=True)):
            worst.see(max(abs(a - b) for a, b in zip(one, other, strict=True)), f"{what} {number}")
    return worst.finding()


def _kinds(small: SmallBuild) -> tuple[Kind, Kind]:
    """Return the switches and the joints of a build, with the scores of its whole rows for its training rows."""
    tables, labels = small.build.tables, small.labels.tolist()
    choices = [np.stack([0 * row, row]).astype(np.int64) for row in tables.switch_rows]
    values: list[NDArray[np.intp]] = list(small.bits.T.astype(np.intp))
    for steps, rows, codes in zip(tables.thresholds, tables.joint_rows, small.codes.T, strict=True):
        choices.append(rows.astype(np.int64))
        values.append(np.searchsorted(steps, codes))
    adds = np.array([rows[of_row] for rows, of_row in zip(choices, values, strict=True)])
    scores = tables.bias + adds.sum(axis=0)

    def kind(inputs: slice) -> Kind:
        without = [*(scores - adds[inputs]), scores - adds[inputs].sum(axis=0)]
        ends = [(rows.min(axis=0).tolist(), rows.max(axis=0).tolist()) for rows in choices[inputs]]
        return Kind([each.tolist() for each in without], labels, ends, tables.scale)

    return kind(slice(tables.n_switches)), kind(slice(tables.n_switches, None))


def _integers(small: SmallBuild, cases: list[Lost]) -> Finding:
    """Integers do not round: the worst frames must change by exactly the bound, and no frame by more."""
    worst = Worst(f"largest change by losing {_SUBSETS}", "the bound itself, in integers", 0, "steps")
    whole = cases[0].scores
    for case in cases:
        for sign in (1, -1):
            most = [change.max(axis=0) for change in changes(small.build.tables, sign)]
            bound = np.sum([m for m, lost in zip(most, case.inputs, strict=True) if lost], axis=0, initial=0)
            found = (sign * (case.scores - whole)).max(axis=0)
            worst.see(float(np.abs(found - bound).max()), case.name, len(whole))
    return worst.finding()


def _sums(small: SmallBuild, cases: list[Lost]) -> Finding:
    """No running sum, in the order of the inputs, may exceed the bound of the build."""
    tables = small.build.tables
    worst = Worst(f"running sums, {_SUBSETS} lost", "the build's bound, at most 32767", tables.bound, "steps")
    for case in cases:
        switches = case.bits.T[:, :, np.newaxis] * tables.switch_rows[:, np.newaxis].astype(np.int64)
        switches[case.switches] = tables.switch_means[case.switches, np.newaxis]
        pairs = zip(tables.thresholds, tables.joint_rows, case.codes.T, strict=True)
        joints = np.stack([rows[np.searchsorted(steps, codes)] for steps, rows, codes in pairs]).astype(np.int64)
        joints[case.joints] = tables.joint_means[case.joints, np.newaxis]
        running = tables.bias + np.cumsum(np.concatenate([switches, joints]), axis=0)
        # The running sums must end at the scores of the scorer.
        differs = not np.array_equal(running[-1], case.scores)
        worst.see(float("inf") if differs else float(np.abs(running).max()), case.name, len(case.bits))
    return worst.finding()


def _reported(small: SmallBuild, cases: list[Lost]) -> Iterator[Finding]:
    degraded = Worst("frames reported as degraded", "those that lost a kept switch or a joint", 0, "frames")
    unread = Worst("outputs that depend on the value of a lost input", "the output without it", 0, "frames")
    build, grasps = small.build, small.build.grasps
    for case in cases:
        lost = case.switches, case.joints
        for bits, codes, scores in zip(case.bits, case.codes, case.scores.tolist(), strict=True):
            found = build.recognise(bits, codes, *lost)
            right = found.degraded == bool(case.inputs.any()) and found.grasp == grasps[first_best(scores)]
            degraded.see(float(not right), case.name)
            other = bits ^ case.switches, np.where(case.joints, HIGHEST_CODE - codes, codes)
            unread.see(float(build.recognise(*other, *lost) != found), case.name)
    yield degraded.finding()
    yield unread.finding()
