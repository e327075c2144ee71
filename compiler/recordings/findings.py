"""What a set of grasps holds that its owner should know: counted, with the first rows and the columns named."""

from collections.abc import Iterator, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from .graspset import GraspSet
from .names import SHOWN, list_names, list_rows


class Finding(msgspec.Struct, frozen=True):
    """One kind of oddity: how often, the first rows as the user counts them, the columns, a sentence for people."""

    kind: str
    count: int
    message: str
    rows: tuple[int, ...] = ()
    columns: tuple[str, ...] = ()


def find_oddities(grasp_set: GraspSet, rows: NDArray[np.int64]) -> tuple[Finding, ...]:
    """Return everything odd about `grasp_set`, whose rows the user knows by the numbers `rows` (n,)."""
    return (*_odd_columns(grasp_set), *_odd_frames(grasp_set, rows), *_gaps(grasp_set))


def constant_columns(columns: NDArray[np.generic], names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of those columns (n, d) that hold one value only."""
    same = (columns == columns[:1]).all(axis=0)
    return tuple(name for name, constant in zip(names, same, strict=True) if constant)


def duplicate_columns(columns: NDArray[np.generic], names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return (name, first column equal to it) for every column (n, d) that repeats another and changes."""
    constant = set(constant_columns(columns, names))
    first: dict[bytes, str] = {}
    pairs = []
    for name, column in zip(names, np.ascontiguousarray(columns.T), strict=True):
        original = first.setdefault(column.tobytes(), name)
        if original != name and name not in constant:
            pairs.append((name, original))
    return tuple(pairs)


def frame_numbers(switches: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.intp]:
    """Return (n,) numbers that are equal exactly where the frames are."""
    frames = np.hstack([np.packbits(switches, axis=1), np.ascontiguousarray(codes).view(np.uint8)])
    if not frames.shape[1]:
        return np.zeros(len(frames), np.intp)
    keys = np.ascontiguousarray(frames).view(np.dtype((np.void, frames.shape[1]))).ravel()
    return np.unique(keys, return_inverse=True)[1]


def disagreeing(frames: NDArray[np.intp], what: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Return (n,) whether the row's frame also occurs with another value of `what` (n,)."""
    _, numbers = np.unique(what, return_inverse=True)
    pairs = np.unique(np.stack([frames, numbers], axis=1), axis=0)
    return np.bincount(pairs[:, 0], minlength=len(frames))[frames] > 1


def _odd_columns(grasp_set: GraspSet) -> Iterator[Finding]:
    for kind, columns, names in (
        ("switch", grasp_set.switches, grasp_set.switch_names),
        ("joint", grasp_set.codes, grasp_set.joint_names),
    ):
        plural = "switches" if kind == "switch" else "joints"
        if constant := constant_columns(columns, names):
            message = f"{len(constant)} {plural} never change: {list_names(constant)}"
            yield Finding(f"constant {plural}", len(constant), message, columns=constant)
        if pairs := duplicate_columns(columns, names):
            shown = list_names([f"{name} = {original}" for name, original in pairs])
            repeated = tuple(name for name, _ in pairs)
            yield Finding(
                f"duplicate {plural}", len(pairs), f"{len(pairs)} {plural} repeat others: {shown}", (), repeated
            )


def _odd_frames(grasp_set: GraspSet, rows: NDArray[np.int64]) -> Iterator[Finding]:
    frames = frame_numbers(grasp_set.switches, grasp_set.codes)
    for kind, what, sentence in (
        ("frames shared by subjects", grasp_set.subjects, "have a frame that another subject has as well"),
        ("contradictory frames", grasp_set.grasps, "have a frame that another grasp type has as well"),
    ):
        found = rows[disagreeing(frames, what)]
        if found.size:
            message = f"{found.size} rows {sentence}: {list_rows(found)}"
            yield Finding(kind, int(found.size), message, tuple(found[:SHOWN].tolist()))


def _gaps(grasp_set: GraspSet) -> Iterator[Finding]:
    subjects, subject = np.unique(grasp_set.subjects, return_inverse=True)
    present, grasp = np.unique(grasp_set.grasps, return_inverse=True)
    # Pairs as numbers: far more can be absent than there are rows, so only those that are shown are listed.
    pairs = np.unique(subject * len(present) + grasp)
    count = len(subjects) * len(present) - len(pairs)
    if count:
        absent = np.setdiff1d(np.arange(min(len(pairs) + SHOWN, len(subjects) * len(present))), pairs)[:SHOWN]
        shown = [f"subject {subjects[pair // len(present)]} has no {present[pair % len(present)]}" for pair in absent]
        yield Finding("grasp types that a subject lacks", count, list_names(shown, count))
