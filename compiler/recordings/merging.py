"""Merge sets of one glove, and split a set by subject, object or session."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import list_names, shortened

from ..publication import entries, publish_folder
from . import RecordingError
from .graspset import CODES, GraspSet, Joint
from .taxonomy import Taxonomy, is_published

By = Literal["subject", "object", "session"]
# The largest distance from integers of codes on two lines that differ only in the last bits of their arithmetic.
_SAME = 1e-3
# The most origins that fit into the description of a simulated set.
_ORIGINS = 4
_RECORDED = "recorded grasps"


def merge(sets: Mapping[str, GraspSet], each: By | None = None) -> GraspSet:
    """Return the rows of all `sets`, one set after the other.

    They have the same switches and joints, in any order; the first set's order is used. Codes are shifted if two
    calibrations differ by whole codes, as for two imports on one grid. Users' own taxonomies are united. Times are kept
    if all sets have them; rows that are separate trials need none, and get 0.

    Parameters
    ----------
    sets : mapping of str to GraspSet
        The sets by name, in order.
    each : "subject", "object" or "session", optional
        Make the rows of each set a separate subject (or object, session), called by the stem of its name.

    Raises
    ------
    RecordingError
        With a message naming the two sets, and the conflicting column, calibration, taxonomy or trial.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, merge
    >>> files = ("monday.grasps", "friday.grasps")
    >>> merge({file: GraspSet.load(file) for file in files}, each="session")  # doctest: +SKIP
    """
    if not sets:
        raise RecordingError("no set to merge")
    own = [found if each is None else _of_its_own(name, found, each) for name, found in sets.items()]
    if each is not None and len(stems := {Path(name).stem for name in sets}) < len(sets):
        raise RecordingError(f"{len(sets)} sets have {len(stems)} names: {list_names(list(sets))}: rename some")
    names, first = list(sets), own[0]
    for name, other in zip(names[1:], own[1:], strict=True):
        _check_columns(names[0], first, name, other)
    taxonomy = _united(names, own)
    _check_trials(names, own)
    still = [len(np.unique(found.movement_ids)) == len(found) for found in own]
    timed = all(found.times_us.size or alone for found, alone in zip(own, still, strict=True))
    timed = timed and any(found.times_us.size for found in own)
    joints, codes = _coded(names, [(found.joints, found.codes) for found in own])
    taxel_columns, taxels = _coded(names, [(found.taxel_columns, found.taxels) for found in own])
    texts = {
        name: np.concatenate([getattr(found, name) for found in own])
        for name in ("grasps", "subjects", "objects", "sessions", "trials")
    }
    places = [dict(zip(found.switch_names, range(len(found.switch_names)), strict=True)) for found in own]
    switches = [
        found.switches[:, [place[name] for name in first.switch_names]]
        for found, place in zip(own, places, strict=True)
    ]
    return GraspSet(
        switches=np.concatenate(switches),
        switch_names=first.switch_names,
        codes=codes,
        joints=joints,
        taxonomy=taxonomy,
        simulated=_origin(own),
        independent=first.independent,
        taxels=taxels,
        taxel_columns=taxel_columns,
        times_us=np.concatenate([found.times_us if found.times_us.size else np.zeros(len(found), int) for found in own])
        if timed
        else first.times_us[:0],
        **texts,
    )


def split(grasp_set: GraspSet, by: By) -> dict[str, GraspSet]:
    """Return the set of each subject, object or session, by name in alphabetical order.

    Each keeps all columns and the whole taxonomy, so `merge` restores the rows, in another order.

    Parameters
    ----------
    grasp_set : GraspSet
        The set to split.
    by : "subject", "object" or "session"
        What each part has only one of.

    Raises
    ------
    RecordingError
        If `by` is anything else.
    """
    column = _column(grasp_set, by)
    return {name: grasp_set.rows(column == name) for name in np.unique(column).tolist()}


def split_into(grasp_set: GraspSet, by: By, folder: Path, *, overwrite: bool = False) -> dict[str, Path]:
    """Write each set of `split` to a file in `folder`, all of them or none; return the files by name.

    A file is called by its name, such as "subject-anna.grasps"; characters that are unsafe in file names become
    underscores. Other files in the folder stay. Raises RecordingError if a file exists already, unless `overwrite`.
    """
    parts = split(grasp_set, by)
    files = _file_names(by, list(parts))

    def theirs(target: Path) -> list[str]:
        there = entries(target)
        if not overwrite and (taken := sorted({*there} & {*files.values()})):
            raise RecordingError(f"{folder} holds {list_names(taken)}: name another folder, or add ``overwrite``")
        return [path for path in there if path not in files.values()]

    content = {files[name]: part.encoded() for name, part in parts.items()}
    publish_folder(content, folder, theirs, RecordingError)
    return {name: folder / file for name, file in files.items()}


def _file_names(by: str, names: list[str]) -> dict[str, str]:
    """Return a file name for each, safe on every system, and distinct even where case is ignored."""
    files: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        stem = file = f"{by}-{re.sub(r'[^A-Za-z0-9_-]', '_', name)[:100]}"
        number = 1
        while file.lower() in taken:
            number += 1
            file = f"{stem}-{number}"
        taken.add(file.lower())
        files[name] = f"{file}.grasps"
    return files


def _of_its_own(name: str, found: GraspSet, each: By) -> GraspSet:
    """Return the set with the stem of its `name` as its only subject, object or session, or in front of several."""
    names, where = np.unique(_column(found, each), return_inverse=True)
    stem = Path(name).stem
    called = [stem] if len(names) == 1 else [f"{stem} {one}" for one in names.tolist()]
    column = np.array(called, np.str_)[where]
    return replace(found, **{f"{each}s": column})  # type: ignore[arg-type]


def _column(grasp_set: GraspSet, by: By) -> NDArray[np.str_]:
    if by not in get_args(By):
        raise RecordingError(f"{by!r} is not one of {list_names(get_args(By))}")
    column: NDArray[np.str_] = getattr(grasp_set, f"{by}s")
    return column


def _check_columns(first_name: str, first: GraspSet, name: str, other: GraspSet) -> None:
    for what, ours, theirs in (
        ("switch", first.switch_names, other.switch_names),
        ("taxel", first.element_names, other.element_names),
        ("joint", first.joint_names, other.joint_names),
    ):
        for lacking, having, of, than in ((theirs, ours, name, first_name), (ours, theirs, first_name, name)):
            if missing := [column for column in having if column not in {*lacking}]:
                plural = "es" if what == "switch" else "s"
                others = [column for column in lacking if column not in {*having}]
                instead = f", and has {list_names(others)} instead" if others else ""
                raise RecordingError(
                    f"{of} lacks {len(missing)} {what}{plural if len(missing) > 1 else ''} that {than} has: "
                    f"{list_names(missing)}{instead}; only sets with the same columns are merged: where one has "
                    "another name, import its table again with [rename] in the columns.toml"
                )
    if first.independent != other.independent:
        claims = (first_name, name) if first.independent else (name, first_name)
        raise RecordingError(f'{claims[0]} states `frames = "independent"`, {claims[1]} does not: import both alike')


def _united(names: list[str], sets: list[GraspSet]) -> Taxonomy:
    taxonomy = sets[0].taxonomy
    for name, other in zip(names[1:], (found.taxonomy for found in sets[1:]), strict=True):
        if taxonomy == other:
            continue
        if is_published(taxonomy) or is_published(other):
            raise RecordingError(
                f"{names[0]} holds grasp types of taxonomy {shortened(taxonomy.name)}, {name} of "
                f"{shortened(other.name)}: import both with one `taxonomy`"
            )
        called = taxonomy.name if taxonomy.name == other.name else "own"
        taxonomy = Taxonomy(called, tuple(dict.fromkeys((*taxonomy.types, *other.types))))
    return taxonomy


def _check_trials(names: list[str], sets: list[GraspSet]) -> None:
    """Raise RecordingError where rows of two sets would become one trial."""
    if sets[0].independent:
        return
    owner: dict[tuple[str, str, str, str, int], str] = {}
    for name, found in zip(names, sets, strict=True):
        columns = (found.subjects, found.grasps, found.objects, found.sessions, found.trials)
        trials = dict.fromkeys(zip(*(column.tolist() for column in columns), strict=True), name)
        if clash := [trial for trial in trials if trial in owner]:
            subject, grasp, thing, session, number = clash[0]
            raise RecordingError(
                f"{len(clash)} trials are in {owner[clash[0]]} and in {name}, the first of subject {subject}, {grasp} "
                f"with {thing}, session {session}, trial {number}: if each file is a separate session, add ``each`` "
                "session; if it is somebody else's, ``each`` subject"
            )
        owner |= trials


_Coded = tuple[tuple[Joint, ...], NDArray[np.uint16]]


def _coded(names: list[str], sets: list[_Coded]) -> _Coded:
    """Return the columns of all `sets` in the order of the first, and all codes (n, j), set after set."""
    own = [{joint.name: (joint, codes[:, place]) for place, joint in enumerate(joints)} for joints, codes in sets]
    lines = tuple(_line(names, [found[joint.name][0] for found in own]) for joint in sets[0][0])
    codes = np.zeros((sum(len(codes) for _, codes in sets), len(lines)), np.uint16)
    for place, line in enumerate(lines):
        moved = []
        for name, (joint, given) in zip(names, (found[line.name] for found in own), strict=True):
            moved.append(given.astype(np.int64) + (int(line.code(joint.value_a)) - joint.code_a))
            if moved[-1].max(initial=0) >= CODES:
                called = shortened(line.name)
                raise RecordingError(f"{name}: {called} gets codes above {CODES - 1}: import with a coarser grid")
        codes[:, place] = np.concatenate(moved)
    return lines, codes


def _line(names: list[str], joints: list[Joint]) -> Joint:
    """Return the joint on whose line the codes of all others are non-negative integers."""
    first = joints[0]
    for name, joint in zip(names, joints, strict=True):
        shift = first.code_a + (joint.value_a - first.value_a) / first.step - joint.code_a
        drift = abs(joint.step / first.step - 1) * CODES
        if joint.unit != first.unit or max(abs(shift - np.rint(shift)), drift) > _SAME:
            raise RecordingError(
                f"{shortened(joint.name)} is calibrated differently in {name} and in {names[0]}: code 0 is "
                f"{joint.value(0):.6g} {shortened(joint.unit)} and a step {joint.step:.6g}, not "
                f"{first.value(0):.6g} {shortened(first.unit)} and {first.step:.6g}; import both with one "
                "`calibration`, or one `grid` and `origin`"
            )
    # The line that starts lowest, or highest if values fall as codes rise.
    return min(joints, key=lambda joint: float(joint.value(0)) / first.step)


def _origin(sets: list[GraspSet]) -> str:
    """Return the simulators of all sets, so that nobody mistakes them for recordings."""
    origins = list(dict.fromkeys(origin for found in sets for origin in found.simulated.split("; ")))
    if len(origins) == 1:
        return origins[0]
    more = f"; {len(origins) - _ORIGINS} more" if len(origins) > _ORIGINS else ""
    return "; ".join(shortened(origin) or _RECORDED for origin in origins[:_ORIGINS]) + more
