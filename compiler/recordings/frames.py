"""Detect frames that are counted as trials, by the similarity of consecutive rows."""

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError

from .graspset import GraspSet
from .summary import Oddity
from .trials import groups

Rows = NDArray[np.intp]

# A frame's distance to the next is below this share of its distance to a row further away. For repetitions this is
# rare, even if they come in blocks of one hand or one action.
_ALIKE = 0.25
# This many times more often than by chance, to be suspicious, and to be refused ...
_EXCESS, _REFUSED = 0.25, 0.4
# ... and by this many standard errors, so that few rows are no evidence.
_ERRORS = 3.0
# Trials are separate if this share of the steps from one to the next exceeds the median step within them.
_APART = 0.75
_SEED = 1


_NUMBER = 'name the column that numbers {} (trial = "..." in columns.toml) and import again'
_STATE = '; or, if each row is a separate trial, state that in place of `trial` (frames = "independent")'


def check_trials(grasp_set: GraspSet, error: type[ThenarError]) -> list[Oddity]:
    """Raise `error`, with the remedies, if rows that count as separate trials look like frames of fewer trials.

    Return a finding if trials resemble their neighbours, but are apart. Does nothing if the set states that its rows
    are independent.
    """
    found = None if grasp_set.independent else _likeness(grasp_set)
    if found is None:
        return []
    reason, remedy = found
    if remedy:
        raise error(f"{reason}: their accuracy would be too high, and its interval too narrow; {remedy}")
    message = (
        f"{reason}: if they were recorded in blocks, with the glove worn or the object placed anew for each "
        "block, name the blocks (`session`), since accuracies on new trials of the same block are too high"
    )
    return [Oddity("alike trials", len(np.unique(grasp_set.trial_ids)), message)]


def looks_like_frames(grasp_set: GraspSet) -> str | None:
    """Return why rows that count as several trials look like the frames of fewer, or None if they do not."""
    reason, remedy = _likeness(grasp_set) or ("", "")
    return reason if remedy else None


def _likeness(grasp_set: GraspSet) -> tuple[str, str] | None:
    """Return in what way trials resemble their neighbours, and what to do, "" if they are apart; None if they do not.

    Rows of one subject, grasp type, object and session are compared in order, ignoring their trial numbers; for
    neighbouring rows of one trial only the middle one. Frames of a trial differ far less from the next than from rows a
    third of the group away or more. For repetitions this happens by chance, and more often with drift, or in blocks
    between which the glove was worn anew; chance is estimated from two rows that are both far away. Trials of several
    rows are apart if the steps between them exceed those within. Not detected are frames whose noise is as large as the
    difference between trials, and a single trial per group; but copies are, if joints differ between groups and the set
    is not simulated. Rows in which nothing is held are ignored: no rate counts them.
    """
    grasp_set = grasp_set.without_none()
    order, group = _units(grasp_set)
    sizes = np.bincount(group) if len(group) else group
    starts = np.cumsum(sizes) - sizes
    place = np.arange(len(order)) - np.repeat(starts, sizes)
    size = np.repeat(sizes, sizes)
    # A scene without noise repeats itself, and its repetitions are numbered correctly.
    if not grasp_set.simulated and (reason := _copies(grasp_set, order, place, starts)):
        return reason, _NUMBER.format("the trials") + _STATE
    this = np.flatnonzero((place + 1 < size) & (size >= 4))
    if not len(this):
        return None
    random = np.random.default_rng(_SEED)
    far, other = (_far(place[this], size[this], random) + this for _ in range(2))
    near, away, chance = _distances(grasp_set, order[this], [order[this + 1], order[far], order[other]])
    closer, by_chance = float(np.mean(near < _ALIKE * away)), float(np.mean(chance < _ALIKE * away))
    excess = closer - by_chance
    if excess < max(_EXCESS, _ERRORS * (0.5 / len(this)) ** 0.5):
        return None
    shares = (
        f"within a subject, grasp type, object and session, {100 * closer:.0f} % of the rows that count as trials are "
        f"less than a quarter as far from the next as from one further away ({100 * by_chance:.0f} % by chance)"
    )
    single = len(order) == len(grasp_set)
    if _are_apart(grasp_set) or (single and excess < _REFUSED):
        return f"trials resemble the trial before: {shares}", ""
    remedy = _NUMBER.format("the trials") + _STATE if single else _NUMBER.format("whole trials")
    return f"the rows look like frames of fewer trials: {shares}", remedy


def _are_apart(grasp_set: GraspSet) -> bool:
    """Return whether steps from one trial to the next are larger than steps between the rows of a trial."""
    group = groups(grasp_set.labels, grasp_set.subjects, grasp_set.objects, grasp_set.sessions)
    order = np.argsort(group, kind="stable")
    before, after = order[:-1], order[1:]
    alike = group[before] == group[after]
    before, after = before[alike], after[alike]
    inside = grasp_set.trial_ids[before] == grasp_set.trial_ids[after]
    count = int(np.count_nonzero(~inside))
    if not count or not inside.any():
        return False
    (steps,) = _distances(grasp_set, before, [after])
    larger = float(np.mean(steps[~inside] > np.median(steps[inside])))
    return larger >= _APART and larger - 0.5 >= _ERRORS * (0.25 / count) ** 0.5


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
    """Return the distances of rows (m,) to others, by all switches and each joint, in units of the last ones' mean."""
    bits, codes = grasp_set.switches, grasp_set.codes.astype(np.int32)
    switches = [np.count_nonzero(bits[rows] != bits[other], axis=1)[:, np.newaxis] for other in others]
    joints = [np.abs(codes[rows] - codes[other]) for other in others]
    scales = [each[-1].mean(axis=0) for each in (switches, joints)]
    weights = [
        np.divide(1.0, scale, out=np.zeros(scale.shape), where=scale > 0) / max(len(scale), 1) for scale in scales
    ]
    return [each @ weights[0] + joint @ weights[1] for each, joint in zip(switches, joints, strict=True)]
