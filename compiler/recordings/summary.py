"""Summarise a set of grasps: counts, balance, columns, oddities, and rows that look like frames but count as trials."""

from collections.abc import Iterator, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError
from thenar.runtime.names import SHOWN, list_names
from thenar.runtime.recording.reader import Oddity

from ..arrays import groups, otsu
from . import list_rows
from .graspset import GraspSet, Joint


def contacts(grasp_set: GraspSet) -> NDArray[np.bool_]:
    """Return which elements (n, s + t) were touched: closed switches, and taxels above Otsu's threshold.

    The threshold is computed over all taxels of a unit, so that the noise of a taxel that is never pressed has no
    effect.
    """
    pressed = np.zeros(grasp_set.taxels.shape, np.bool_)
    units = np.array([taxel.unit for taxel in grasp_set.taxel_columns])
    values = [taxel.value(codes) for taxel, codes in zip(grasp_set.taxel_columns, grasp_set.taxels.T, strict=True)]
    for unit in np.unique(units):
        own = np.flatnonzero(units == unit)
        same = np.column_stack([values[place] for place in own])
        pressed[:, own] = same > otsu(same.ravel())
    return np.hstack([grasp_set.switches, pressed])


def find_oddities(grasp_set: GraspSet, rows: NDArray[np.int64]) -> tuple[Oddity, ...]:
    """Return all oddities of `grasp_set`, whose rows have the numbers `rows` (n,) for the user.

    Rows in which nothing is held are naturally alike, and so not compared.
    """
    columns = tuple(_odd_columns(grasp_set))
    rows, grasp_set = rows[~grasp_set.is_none], grasp_set.without_none()
    return (*columns, *_odd_frames(grasp_set, rows), *_gaps(grasp_set))


def constant_columns(columns: NDArray[np.generic], names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the columns (n, d) that are constant."""
    same = (columns == columns[:1]).all(axis=0)
    return tuple(name for name, constant in zip(names, same, strict=True) if constant)


def duplicate_columns(columns: NDArray[np.generic], names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return (name, first equal column) for every non-constant column (n, d) that repeats another."""
    constant = set(constant_columns(columns, names))
    first: dict[bytes, str] = {}
    pairs = []
    for name, column in zip(names, np.ascontiguousarray(columns.T), strict=True):
        original = first.setdefault(column.tobytes(), name)
        if original != name and name not in constant:
            pairs.append((name, original))
    return tuple(pairs)


def frame_numbers(grasp_set: GraspSet) -> NDArray[np.intp]:
    """Return numbers (n,) that are equal exactly if the frames are."""
    codes = np.ascontiguousarray(np.hstack([grasp_set.taxels, grasp_set.codes]))
    frames = np.hstack([np.packbits(grasp_set.switches, axis=1), codes.view(np.uint8)])
    if not frames.shape[1]:
        return np.zeros(len(frames), np.intp)
    keys = np.ascontiguousarray(frames).view(np.dtype((np.void, frames.shape[1]))).ravel()
    return np.unique(keys, return_inverse=True)[1]


def disagreeing(frames: NDArray[np.intp], values: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Return (n,) whether the row's frame also occurs with another one of `values` (n,)."""
    found, numbers = np.unique(values, return_inverse=True)
    # Pairs encoded as numbers need a fraction of the memory. Done in place, as a large set is in memory already.
    numbers += frames * len(found)
    pairs = np.unique(numbers)
    return np.bincount(pairs // max(len(found), 1), minlength=len(frames))[frames] > 1


def _odd_columns(grasp_set: GraspSet) -> Iterator[Oddity]:
    for kind, columns, names in (
        ("switch", grasp_set.switches, grasp_set.switch_names),
        ("taxel", grasp_set.taxels, grasp_set.taxel_names),
        ("joint", grasp_set.codes, grasp_set.joint_names),
    ):
        plural = "switches" if kind == "switch" else f"{kind}s"
        if constant := constant_columns(columns, names):
            message = f"{len(constant)} {plural} never change: {list_names(constant)}"
            yield Oddity(f"constant {plural}", len(constant), message, columns=constant)
        if pairs := duplicate_columns(columns, names):
            shown = list_names([f"{name} = {original}" for name, original in pairs])
            repeated = tuple(name for name, _ in pairs)
            yield Oddity(
                f"duplicate {plural}", len(pairs), f"{len(pairs)} {plural} repeat others: {shown}", (), repeated
            )


def _odd_frames(grasp_set: GraspSet, rows: NDArray[np.int64]) -> Iterator[Oddity]:
    frames = frame_numbers(grasp_set)
    for kind, values, sentence in (
        ("frames shared by subjects", grasp_set.subjects, "have a frame that another subject has as well"),
        ("contradictory frames", grasp_set.grasps, "have a frame that another grasp type has as well"),
    ):
        odd = disagreeing(frames, values)
        if count := int(np.count_nonzero(odd)):
            message = f"{count} rows {sentence}: {list_rows(rows[odd])}"
            yield Oddity(kind, count, message, tuple(rows[odd][:SHOWN].tolist()))


def _gaps(grasp_set: GraspSet) -> Iterator[Oddity]:
    subjects, subject = np.unique(grasp_set.subjects, return_inverse=True)
    present, grasp = np.unique(grasp_set.grasps, return_inverse=True)
    # Encoded as numbers: many more pairs can be absent than there are rows, so only those shown are listed.
    pairs = np.unique(subject * len(present) + grasp)
    count = len(subjects) * len(present) - len(pairs)
    if count:
        absent = np.setdiff1d(np.arange(min(len(pairs) + SHOWN, len(subjects) * len(present))), pairs)[:SHOWN]
        shown = [f"subject {subjects[pair // len(present)]} has no {present[pair % len(present)]}" for pair in absent]
        yield Oddity("grasp types that a subject lacks", count, list_names(shown, count))


class JointRange(msgspec.Struct, frozen=True):
    """The range of a joint or taxel in its unit, None in an empty set, and the number of distinct codes."""

    name: str
    unit: str
    least: float | None
    largest: float | None
    codes: int


class Summary(msgspec.Struct, frozen=True):
    """A set in numbers.

    rests        number of trials in which nothing is held; they count in no rate
    none         number of frames in which nothing is held
    movements    number of trials, including the rows around them in which nothing is held
    seconds      total duration of the recordings; None if times are unknown
    simulated    the simulator of the grasps; empty: they were recorded
    independent  each row is stated to be a separate trial
    grasps       number of frames of each grasp type that occurs; likewise subjects and objects
    balance      the rarest grasp type's count divided by the most frequent one's
    switches     share of frames in which each switch is closed, 0 to 1
    """

    frames: int
    trials: int
    rests: int
    none: int
    movements: int
    seconds: float | None
    simulated: str
    independent: bool
    fingerprint: str
    taxonomy: str
    grasps: dict[str, int]
    absent: tuple[str, ...]
    balance: float
    subjects: dict[str, int]
    objects: dict[str, int]
    switches: dict[str, float]
    taxels: tuple[JointRange, ...]
    joints: tuple[JointRange, ...]
    warnings: tuple[Oddity, ...]


def summarise(grasp_set: GraspSet) -> Summary:
    """Return the summary of `grasp_set`, with rows counted from 1."""
    counts = np.bincount(grasp_set.labels[~grasp_set.is_none], minlength=len(grasp_set.taxonomy.types))
    grasps = dict(zip(grasp_set.taxonomy.types, counts.tolist(), strict=True))
    closed = grasp_set.switches.sum(axis=0) / max(len(grasp_set), 1)
    present = counts[counts > 0]
    seconds = None
    if grasp_set.times_us.size:
        steps = np.diff(grasp_set.times_us)[np.diff(groups(grasp_set.subjects, grasp_set.sessions)) == 0]
        seconds = float(steps[steps > 0].sum() / 1e6)
    return Summary(
        frames=len(grasp_set),
        trials=grasp_set.n_trials,
        rests=grasp_set.rests,
        none=int(grasp_set.is_none.sum()),
        movements=int(grasp_set.movement_ids.max(initial=-1)) + 1,
        seconds=seconds,
        simulated=grasp_set.simulated,
        independent=grasp_set.independent,
        fingerprint=grasp_set.fingerprint(),
        taxonomy=grasp_set.taxonomy.name,
        grasps={name: rows for name, rows in grasps.items() if rows},
        absent=tuple(name for name, rows in grasps.items() if not rows),
        balance=float(present.min() / present.max()) if present.size else 0.0,
        subjects=_counts(grasp_set.subjects),
        objects=_counts(grasp_set.objects),
        switches=dict(zip(grasp_set.switch_names, closed.tolist(), strict=True)),
        taxels=_ranges(grasp_set.taxel_columns, grasp_set.taxels),
        joints=_ranges(grasp_set.joints, grasp_set.codes),
        warnings=find_oddities(grasp_set, np.arange(1, len(grasp_set) + 1)),
    )


def _counts(names: NDArray[np.str_]) -> dict[str, int]:
    found, counts = np.unique(names, return_counts=True)
    return dict(zip(found.tolist(), counts.tolist(), strict=True))


def _ranges(joints: Sequence[Joint], columns: NDArray[np.uint16]) -> tuple[JointRange, ...]:
    ranges = []
    for joint, codes in zip(joints, columns.T, strict=True):
        taken = np.unique(codes)
        ends: list[float] = joint.value(taken[[0, -1]]).tolist() if taken.size else []
        least, largest = min(ends, default=None), max(ends, default=None)
        ranges.append(JointRange(joint.name, joint.unit, least, largest, len(taken)))
    return tuple(ranges)


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
    order, group = _in_groups(grasp_set)
    first = np.flatnonzero(np.diff(grasp_set.trial_ids[order], prepend=-1) != 0)
    middle = first + np.diff(first, append=len(order)) // 2
    rows, group = order[middle], group[middle]
    # A scene without noise repeats itself, and its repetitions are numbered correctly.
    if not grasp_set.simulated and (reason := _copies(grasp_set, rows, group)):
        return reason, _NUMBER.format("the trials") + _STATE
    sizes = np.bincount(group) if len(group) else group
    place = np.arange(len(rows)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    size = np.repeat(sizes, sizes)
    this = np.flatnonzero((place + 1 < size) & (size >= 4))
    if not len(this):
        return None
    # Two others of the group for each row, drawn from those that are a third of it away or more, at least two.
    random, place, size = np.random.default_rng(_SEED), place[this], size[this]
    least = np.maximum(2, -(-size // 3))
    before, after = np.maximum(place - least + 1, 0), np.maximum(size - place - least, 0)
    drawn = random.integers(0, before + after, (2, len(this)))
    far = rows[this + np.where(drawn < before, -least - drawn, least + drawn - before)]
    near, away, chance = _distances(grasp_set, rows[this], [rows[this + 1], *far])
    closer, by_chance = float(np.mean(near < _ALIKE * away)), float(np.mean(chance < _ALIKE * away))
    excess = closer - by_chance
    if excess < max(_EXCESS, _ERRORS * (0.5 / len(this)) ** 0.5):
        return None
    shares = (
        f"within a subject, grasp type, object and session, {100 * closer:.0f} % of the rows that count as trials are "
        f"less than a quarter as far from the next as from one further away ({100 * by_chance:.0f} % by chance)"
    )
    single = len(rows) == len(grasp_set)
    if _are_apart(grasp_set) or (single and excess < _REFUSED):
        return f"trials resemble the trial before: {shares}", ""
    remedy = _NUMBER.format("the trials") + _STATE if single else _NUMBER.format("whole trials")
    return f"the rows look like frames of fewer trials: {shares}", remedy


def _are_apart(grasp_set: GraspSet) -> bool:
    """Return whether steps from one trial to the next are larger than steps between the rows of a trial."""
    order, group = _in_groups(grasp_set)
    alike = group[:-1] == group[1:]
    rows, others = order[:-1][alike], order[1:][alike]
    inside = grasp_set.trial_ids[rows] == grasp_set.trial_ids[others]
    count = int(np.count_nonzero(~inside))
    if not count or not inside.any():
        return False
    (steps,) = _distances(grasp_set, rows, [others])
    larger = float(np.mean(steps[~inside] > np.median(steps[inside])))
    return larger >= _APART and larger - 0.5 >= _ERRORS * (0.25 / count) ** 0.5


def _in_groups(grasp_set: GraspSet) -> tuple[Rows, Rows]:
    """Return the rows (n,) in the order of groups, and the groups (n,) in this order."""
    group = groups(grasp_set.labels, grasp_set.subjects, grasp_set.objects, grasp_set.sessions)
    order = np.argsort(group, kind="stable")
    return order, group[order]


def _copies(grasp_set: GraspSet, rows: Rows, group: Rows) -> str | None:
    """Return why rows look like copies, if most equal the previous row while groups rarely start with the same row."""
    begins = np.diff(group, prepend=-1) != 0
    starts, later = np.flatnonzero(begins), np.flatnonzero(~begins)
    if not grasp_set.joints or len(starts) < 3:
        return None
    frames = np.hstack([grasp_set.codes, grasp_set.switches])[rows]
    equal = (frames[later] == frames[later - 1]).all(axis=1)
    if 2 * np.count_nonzero(equal) <= len(later) or len(np.unique(frames[starts], axis=0)) < 0.9 * len(starts):
        return None
    return (
        f"{100 * equal.mean():.0f} % of the rows that count as trials equal the one before in every joint and switch: "
        "they look like copies of fewer trials"
    )


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
