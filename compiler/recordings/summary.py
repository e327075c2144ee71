"""What `thenar info` says of a set: counts, balance, columns, oddities, and how separable its grasp types are."""

import msgspec
import numpy as np
from numpy.typing import NDArray

from .findings import Finding, find_oddities
from .graspset import GraspSet
from .separability import Separability, separabilities


class Count(msgspec.Struct, frozen=True):
    """How many rows have `name`."""

    name: str
    rows: int


class SwitchUse(msgspec.Struct, frozen=True):
    """How often a switch is closed: 0 to 1."""

    name: str
    closed: float


class JointRange(msgspec.Struct, frozen=True):
    """Least and largest value of a joint in its unit, None in a set without rows; how many distinct codes it takes."""

    name: str
    unit: str
    least: float | None
    largest: float | None
    codes: int


class Summary(msgspec.Struct, frozen=True):
    """A set in numbers.

    simulated  what simulated the grasps; empty: they were recorded
    balance    the rarest grasp type's count over the commonest one's
    """

    rows: int
    simulated: str
    fingerprint: str
    taxonomy: str
    grasps: tuple[Count, ...]
    absent: tuple[str, ...]
    balance: float
    subjects: tuple[Count, ...]
    objects: tuple[Count, ...]
    switches: tuple[SwitchUse, ...]
    joints: tuple[JointRange, ...]
    separability: tuple[Separability, ...]
    warnings: tuple[Finding, ...]


def summarise(grasp_set: GraspSet) -> Summary:
    """Return the summary of `grasp_set`, whose rows count from 1. A set without rows has no separability."""
    counts = np.bincount(grasp_set.labels, minlength=len(grasp_set.taxonomy.types))
    grasps = [Count(name, int(rows)) for name, rows in zip(grasp_set.taxonomy.types, counts, strict=True)]
    present = counts[counts > 0]
    return Summary(
        rows=len(grasp_set),
        simulated=grasp_set.simulated,
        fingerprint=grasp_set.fingerprint(),
        taxonomy=grasp_set.taxonomy.name,
        grasps=tuple(count for count in grasps if count.rows),
        absent=tuple(count.name for count in grasps if not count.rows),
        balance=float(present.min() / present.max()) if present.size else 0.0,
        subjects=_counts(grasp_set.subjects),
        objects=_counts(grasp_set.objects),
        switches=_switches(grasp_set),
        joints=_joints(grasp_set),
        separability=separabilities(grasp_set),
        warnings=find_oddities(grasp_set, np.arange(1, len(grasp_set) + 1)),
    )


def _counts(names: NDArray[np.str_]) -> tuple[Count, ...]:
    found, counts = np.unique(names, return_counts=True)
    return tuple(map(Count, found.tolist(), counts.tolist()))


def _switches(grasp_set: GraspSet) -> tuple[SwitchUse, ...]:
    closed = grasp_set.switches.sum(axis=0) / max(len(grasp_set), 1)
    return tuple(map(SwitchUse, grasp_set.switch_names, closed.tolist()))


def _joints(grasp_set: GraspSet) -> tuple[JointRange, ...]:
    ranges = []
    for joint, codes in zip(grasp_set.joints, grasp_set.codes.T, strict=True):
        taken = np.unique(codes)
        ends: list[float] = joint.value(taken[[0, -1]]).tolist() if taken.size else []
        least, largest = min(ends, default=None), max(ends, default=None)
        ranges.append(JointRange(joint.name, joint.unit, least, largest, len(taken)))
    return tuple(ranges)
