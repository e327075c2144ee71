"""Ports that do not reply and joints that stop sending; rows fitted to the training rows replace them."""

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.build import Build
from thenar.runtime.model.terms.base import HIGHEST_CODE
from thenar.runtime.scores import LANE_OFFSET

from ..finding import Finding
from ..inputs.hard_tables import Bits, Codes
from ..inputs.small_sets import SmallBuild, small_build, small_set
from ..reference.numbers import precisely
from ..reference.standing_in import Kind, in_bytes, stand_ins
from ..reference.tables import balanced, mean_row


class Lost(NamedTuple):
    """What is lost, switches (s,) and joints (j,), and n frames: bits (n, s), codes (n, j), scores (n, K) under it."""

    name: str
    switches: Bits
    joints: Bits
    bits: Bits
    codes: Codes
    scores: NDArray[np.int64]


def findings(full: bool) -> Iterator[Finding]:
    """Lose every subset of joints and of ports, of 8 and of 16 switches, in recorded frames and in two extreme ones."""
    if full:
        small = small_build(small_set(8, rows=150, switches=48, joints=4, types=5, noise=0.15), rounds=40)
    else:
        small = small_build(small_set(8, rows=100, switches=32, joints=2, types=4, noise=0.1), rounds=20)
    recorded = 24 if full else 8
    tables = small.build.tables
    # The frames in which the first type's score is largest and least.
    first, joints = tables.switch_rows[:, 0], [tables.choices(joint) for joint in range(tables.n_joints)]
    bits = np.vstack([small.bits[:recorded], first > 0, first < 0])
    extreme = [[at[of(rows[:, 0])] for at, rows in joints] for of in (np.argmax, np.argmin)]
    codes = np.vstack([small.codes[:recorded], extreme]).astype(np.uint16)
    cases = [case for width in (8, 16) for case in every_loss(small.build, width, bits, codes)]
    yield _fitted(small)
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
        lanes = [build.scorer.biased_scores(*frame, *lost) for frame in zip(bits, codes, strict=True)]
        yield Lost(name, *lost, bits, codes, np.array(lanes) - LANE_OFFSET)


def _fitted(small: SmallBuild) -> Finding:
    """Compare the replacement of each input with the same fit at 60 digits, whose numbers are integers as well."""
    worst = Finding.of("the replacement of each input", "the fit at 60 digits", 0, "steps")
    tables, integers = small.tables, small.build.tables
    _, joint_rows = balanced(tables.bias.tolist(), [rows.tolist() for rows in tables.joint_rows])
    of_switches = zip(tables.switch_rows, small.bits.T.tolist(), strict=True)
    of_joints = zip(map(np.ndarray.tolist, tables.thresholds), joint_rows, small.codes.T.tolist(), strict=True)
    means = (
        [mean_row([0], [(0 * row).tolist(), row.tolist()], bits) for row, bits in of_switches],
        [mean_row(*joint) for joint in of_joints],
    )
    got = integers.switch_means.tolist(), integers.joint_means.tolist()
    zeros = (0 * integers.switch_rows).tolist(), [rows[0].tolist() for rows in integers.joint_rows]
    for what, kind, of_kind, zero, rows in zip(("switch", "joint"), _kinds(small), means, zeros, got, strict=True):
        with precisely():
            in_steps = [[value * integers.scale for value in row] for row in of_kind]
        held = map(in_bytes, stand_ins(kind, in_steps), zero, kind.ends)
        for number, (one, other) in enumerate(zip(held, rows, strict=True)):
            worst.see(max(abs(a - b) for a, b in zip(one, other, strict=True)), f"{what} {number}")
    return worst


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


def _sums(small: SmallBuild, cases: list[Lost]) -> Finding:
    """No running sum, in the order of the inputs, may exceed the bound of the build."""
    tables = small.build.tables
    worst = Finding.of(
        "running sums, every subset of ports and joints lost", "the build's bound, at most 32767", tables.bound, "steps"
    )
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
    return worst


def _reported(small: SmallBuild, cases: list[Lost]) -> Iterator[Finding]:
    degraded = Finding.of("frames reported as degraded", "those that lost a kept switch or a joint", 0, "frames")
    unread = Finding.of("outputs that depend on the value of a lost input", "the output without it", 0, "frames")
    build, grasps = small.build, small.build.grasps
    for case in cases:
        lost = case.switches, case.joints
        any_lost = any(part.any() for part in lost)
        for bits, codes, scores in zip(case.bits, case.codes, case.scores.tolist(), strict=True):
            found = build.recognise(bits, codes, *lost)
            right = found.degraded == any_lost and found.grasp == grasps[scores.index(max(scores))]
            degraded.see(float(not right), case.name)
            other = bits ^ case.switches, np.where(case.joints, HIGHEST_CODE - codes, codes)
            unread.see(float(build.recognise(*other, *lost) != found), case.name)
    yield from (degraded, unread)
