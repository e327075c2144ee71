"""What a frame can lose together: the switches on a port, or a joint. And frames for which that is worst."""

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.tables.collapse import HIGHEST_CODE
from thenar.compiler.tables.furthest import furthest
from thenar.runtime.build import Build
from thenar.runtime.tables import IntegerTables

from ..inputs.hard_tables import Bits, Codes


class Loss(NamedTuple):
    """Masks of kept switches (s,) and joints (j,) that cannot be read, and in words what is silent."""

    switches: Bits
    joints: Bits
    name: str

    @property
    def inputs(self) -> Bits:
        """Switches, then joints."""
        return np.concatenate([self.switches, self.joints])


def every_loss(build: Build, width: int) -> Iterator[Loss]:
    """Yield every subset of ports, `width` switches each in the order of their columns, and joints.

    On the last port there is no kept switch.
    """
    ports = np.array([switch.column // width for switch in build.manifest.switches])
    n_ports, n_joints = int(ports.max()) + 2, build.tables.n_joints
    for silent in product((False, True), repeat=n_ports + n_joints):
        masks = np.array(silent)
        name = f"silent of {n_ports} ports {np.flatnonzero(masks[:n_ports])}, joints {np.flatnonzero(masks[n_ports:])}"
        yield Loss(masks[:n_ports][ports], masks[n_ports:], name)


def changes(tables: IntegerTables, sign: int) -> list[NDArray[np.int64]]:
    """Return per input, times `sign`, what its mean adds to a score beyond what each value adds, (values, K) steps."""
    pairs = [
        (np.stack([0 * row, row]), mean) for row, mean in zip(tables.switch_rows, tables.switch_means, strict=True)
    ]
    pairs += zip(tables.joint_rows, tables.joint_means, strict=True)
    return [sign * (mean.astype(np.int64) - rows) for rows, mean in pairs]


def worst_frames(tables: IntegerTables) -> Iterator[tuple[Bits, Codes]]:
    """Yield the frames in which a loss changes a score most, and those whose sums get furthest from zero.

    Inputs know nothing of each other, so the first are, for a class and a direction, the same whatever is lost. Codes
    are the lowest, then the highest, of their bins.
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
