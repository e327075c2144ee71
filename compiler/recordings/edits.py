"""Edits of recorded trials: another grasp type, or left out; kept in a log, since a recording never changes.

The log has one JSON object a line, an `Edit`. The last edit of a trial counts.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.files import read_file

from . import LARGEST, RecordingError
from .graspset import GraspSet
from .merging import By, merge

# A trial as it was recorded: the name of its set's file, subject, session, grasp type, object and number; rows that are
# separate trials are numbered from 1.
TrialId = tuple[str, str, str, str, str, int]


class Edit(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What became of a trial. An action of a user edits one trial or many.

    time     when, in UTC
    action   the number of the action, from 1
    set, subject, session, grasp, object, trial  as a `TrialId`
    old, new  the type before and after; empty: the trial is left out
    undo     the number of the action that this one takes back; 0: none
    """

    time: str
    action: int
    set: str
    subject: str
    session: str
    grasp: str
    object: str
    trial: int
    old: str
    new: str
    undo: int = 0

    @property
    def of(self) -> TrialId:
        """The trial."""
        return (self.set, self.subject, self.session, self.grasp, self.object, self.trial)


def read_edits(path: Path) -> tuple[list[Edit], str]:
    """Return the edits of a log; and a sentence if its last line, which a kill left unfinished, was ignored.

    Raises RecordingError for a damaged line before the last one, and OSError.
    """
    lines, edits = read_file(path, LARGEST, RecordingError).splitlines(), list[Edit]()
    for number, line in enumerate(lines, 1):
        try:
            edits.append(msgspec.json.decode(line, type=Edit))
        except (msgspec.DecodeError, UnicodeDecodeError) as wrong:
            if number == len(lines):
                return edits, f"{path}: line {number}, the last, is damaged, and was ignored"
            raise RecordingError(f"{path}: line {number} is no edit: {wrong}; correct it, or delete it") from None
    return edits, ""


def apply_edits(
    sets: Mapping[str, GraspSet], edits: Iterable[Edit], each: By | None = None
) -> tuple[GraspSet, list[TrialId], list[str]]:
    """Merge sets, with edits of their trials.

    A trial that is left out takes the rows along in which nothing was held before and after it. One that would have
    the type, subject, object, session and number of another gets a free number.

    Parameters
    ----------
    sets : mapping of str to GraspSet
        The sets by the paths of their files.
    edits : iterable of Edit
        The edits, oldest first.
    each : "subject", "object" or "session", optional
        As for `merge`.

    Returns
    -------
    grasp_set : GraspSet
        The set of n rows.
    trials : list of TrialId
        For each row the trial as it was recorded (n).
    unused : list of str
        For every edited trial that is not there, or whose type is not, a sentence.

    Raises
    ------
    RecordingError
        As `merge` does.
    """
    merged = next(iter(sets.values())) if len(sets) == 1 and each is None else merge(sets, each)
    trials, ids = list[TrialId](), list[NDArray[np.intp]]()
    for path, grasp_set in sets.items():
        ids.append(grasp_set.trial_ids + len(trials))
        trials += trials_of(Path(path).name, grasp_set)
    rows, numbers = np.concatenate(ids), {trial: number for number, trial in enumerate(trials)}
    latest, types, unused = {edit.of: edit.new for edit in edits}, {}, list[str]()
    for trial, new in latest.items():
        if trial not in numbers or trial[3] not in merged.taxonomy.types:
            unused.append(f"{named(trial)} was edited, but is not there")
        elif new and new not in merged.taxonomy.types:
            unused.append(f"{named(trial)} was made {new}, which is not a type of taxonomy {merged.taxonomy.name}")
        elif new != trial[3]:
            types[numbers[trial]] = new
    if not types:
        return merged, [trials[number] for number in rows.tolist()], unused
    edited, kept = _edited(merged, rows, types)
    return edited, [trials[number] for number in rows[kept].tolist()], unused


def named(trial: TrialId) -> str:
    """Return a trial in words."""
    file, subject, session, grasp, thing, number = trial
    return f"trial {number} of {subject}, {thing}, {grasp}, session {session} of {file}"


def trials_of(name: str, grasp_set: GraspSet) -> list[TrialId]:
    """Return the trials of a set, by the name of its file, in the order of their first rows."""
    first = np.unique(grasp_set.trial_ids, return_index=True)[1]
    numbers = first + 1 if grasp_set.independent else grasp_set.trials[first]
    columns = (grasp_set.subjects, grasp_set.sessions, grasp_set.grasps, grasp_set.objects)
    texts = (column[first].tolist() for column in columns)
    return [(name, *trial) for trial in zip(*texts, numbers.tolist(), strict=True)]


def _edited(merged: GraspSet, trials: NDArray[np.intp], types: Mapping[int, str]) -> tuple[GraspSet, NDArray[np.intp]]:
    """Return the set with new types (empty: left out) of trials by their number, and the rows that are kept.

    trials  the number of each row's trial (n,)
    """
    movements, first = merged.movement_ids, np.unique(trials, return_index=True)[1]
    gone = [movements[first[trial]] for trial, new in types.items() if not new]
    changed = sorted(trial for trial, new in types.items() if new)
    labels, repetitions = merged.labels.copy(), merged.trials.copy()
    for trial in changed:
        labels[trials == trial] = merged.taxonomy.types.index(types[trial])
    grasps = np.array(merged.taxonomy.names)[labels]
    if not merged.independent:
        columns = (grasps, merged.subjects, merged.objects, merged.sessions, repetitions)
        keys = list(zip(*(column[first].tolist() for column in columns), strict=True))
        taken = {key for trial, key in enumerate(keys) if trial not in types}
        used = {*repetitions.tolist()}
        free = (number for number in count(1) if number not in used)
        for trial in changed:
            if keys[trial] in taken:
                repetitions[movements == movements[first[trial]]] = next(free)
            taken.add(keys[trial])
    kept = np.flatnonzero(~np.isin(movements, gone))
    return replace(merged, grasps=grasps, trials=repetitions).rows(kept), kept
