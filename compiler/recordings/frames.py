"""Detect frames that are counted as trials, by the similarity of consecutive rows."""

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError

from .graspset import GraspSet
from .trials import groups

Rows = NDArray[np.intp]

# A frame's distance to the next is below this share of its distance to a row further away. For repetitions this is
# rare, even if they come in blocks of one hand or one action.
_ALIKE = 0.25
# This many times more often than by chance ...
_EXCESS = 0.25
# ... and by this many standard errors, so that few rows are no evidence.
_ERRORS = 3.0
_SEED = 1


def check_trials(grasp_set: GraspSet, error: type[ThenarError]) -> None:
    """Raise `error`, with the remedies, if rows that count as separate trials look like frames of fewer trials.

    Does nothing if the set states that its rows are independent.
    """
    if not grasp_set.independent and (found := looks_like_frames(grasp_set)):
        raise error(
            f"{found}: their accuracy would be too high, and its interval too narrow. Name the column that numbers the "
            'trials (trial = "..." in columns.toml) and import again; or, if each row is a separate trial, state it '
            '(frames = "independent")'
        )


def looks_like_frames(grasp_set: GraspSet) -> str | None:
    """Return why rows that count as several trials look like the frames of fewer, or None if they do not.

    Rows of one subject, grasp type, object and session are compared in order, ignoring their trial numbers; for
    neighbouring rows of one trial only the middle one. Frames of a trial differ far less from the next than from rows a
    third of the group away or more. For repetitions this happens by chance, and slightly more often with drift; chance
    is estimated from two rows that are both far away. Not detected are frames whose noise is as large as the difference
    between trials, and a single trial per group; but copies are, if joints differ between groups and the set is not
    simulated. Rows in which nothing is held are ignored: no rate counts them.
    """
    grasp_set = grasp_set.without_none()
    order, group = _units(grasp_set)
    sizes = np.bincount(group) if len(group) else group
    starts = np.cumsum(sizes) - sizes
    place = np.arange(len(order)) - np.repeat(starts, sizes)
    size = np.repeat(sizes, sizes)
    # A scene without noise repeats itself, and its repetitions are numbered correctly.
    if not grasp_set.simulated and (reason := _copies(grasp_set, order, place, starts)):
        return reason
    this = np.flatnonzero((place + 1 < size) & (size >= 4))
    if not len(this):
        return None
    random = np.random.default_rng(_SEED)
    far, other = (_far(place[this], size[this], random) + this for _ in range(2))
    near, away, chance = _distances(grasp_set, order[this], [order[this + 1], order[far], order[other]])
    closer, by_chance = float(np.mean(near < _ALIKE * away)), float(np.mean(chance < _ALIKE * away))
    if closer - by_chance < max(_EXCESS, _ERRORS * (0.5 / len(this)) ** 0.5):
        return None
    return (
        "the rows look like frames of fewer trials: within a subject, grasp type, object and session, "
        f"{100 * closer:.0f} % of the rows that count as trials are less than a quarter as far from the next as "
        f"from one further away ({100 * by_chance:.0f} % by chance)"
    )


def _units(grasp_set: GraspSet) -> tuple[Rows, Rows]:
    """Return the middle row (m,) of each run of rows of one trial, in the order of groups, and the groups (m,)."""
    group = groups(grasp_set.labels, grasp_set.subjects, grasp_set.objects, grasp_set.sessions)
    order = np.argsort(group, kind="stable")
    trial = grasp_set.trial_ids[order]
    first = np.flatnonzero(np.diff(trial, prepend=-1) != 0)
    middle = (first + np.append(first[1:], len(order))) // 2
    return order[middle], group[order[middle]]


def _copies(grasp_set: GraspSet, order: Rows, place: Rows, starts: Rows) -> str | None:
    """Return why rows look like copies, if most equal the previous row while groups rarely start with the same row."""
    if not grasp_set.joints or len(starts) < 3:
        return None
    rows = np.hstack([grasp_set.codes, grasp_set.switches])[order]
    later = np.flatnonzero(place > 0)
    equal = (rows[later] == rows[later - 1]).all(axis=1)
    if 2 * np.count_nonzero(equal) <= len(later) or len(np.unique(rows[starts], axis=0)) < 0.9 * len(starts):
        return None
    return (
        f"{100 * equal.mean():.0f} % of the rows that count as trials equal the one before in every joint and switch: "
        "they look like copies of fewer trials"
    )


def _far(place: Rows, size: Rows, random: np.random.Generator) -> Rows:
    """Return a row offset (m,) for each row, drawn from those of the group a third of it away or more, at least two."""
    least = np.maximum(2, -(-size // 3))
    before, after = np.maximum(place - least + 1, 0), np.maximum(size - place - least, 0)
    drawn = random.integers(0, before + after)
    away: Rows = np.where(drawn < before, -least - drawn, least + drawn - before)
    return away


def _distances(grasp_set: GraspSet, rows: Rows, others: list[Rows]) -> list[NDArray[np.float64]]:
    """Return the distances of rows (m,) to others, by all switches and each joint, in units of the second's mean."""
    bits, codes = grasp_set.switches, grasp_set.codes.astype(np.int32)
    switches = [np.count_nonzero(bits[rows] != bits[other], axis=1)[:, np.newaxis] for other in others]
    joints = [np.abs(codes[rows] - codes[other]) for other in others]
    scales = [each[1].mean(axis=0) for each in (switches, joints)]
    weights = [
        np.divide(1.0, scale, out=np.zeros(scale.shape), where=scale > 0) / max(len(scale), 1) for scale in scales
    ]
    return [each @ weights[0] + joint @ weights[1] for each, joint in zip(switches, joints, strict=True)]
