"""Import a table and its columns.toml as a `GraspSet`, with a report on the content and on coding losses."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from thenar.runtime.names import list_names, nearest, shortened
from thenar.runtime.published import NONE
from thenar.runtime.recording.reader import Oddity

from ..arrays import groups
from . import TYPES, RecordingError, TableError, check_names, check_room, list_rows
from .columns import ColumnRoles, JointColumns, TaxelColumns, read_columns, select, sound_grid
from .graspset import CODES, GraspSet, Joint
from .inputs import WORDS, Course, possible_clocks, words_of
from .joining import read_joined
from .readings import Readings, meanings, nothing_held, read_cells, whole
from .summary import check_trials, find_oddities, looks_like_frames
from .table import Table
from .taxonomy import Taxonomy, own, plain, published
from .trial_files import Report


class CodingCost(msgspec.Struct, frozen=True):
    """The loss from coding one joint: errors in `unit`, distinct values before and after."""

    joint: str
    unit: str
    step: float
    largest_error: float
    distinct_before: int
    distinct_after: int

    @property
    def rounds(self) -> bool:
        """Whether coding changes values by more than the arithmetic does, or makes some equal."""
        return self.largest_error > 1e-6 * self.step or self.distinct_after < self.distinct_before


class ImportReport(msgspec.Struct, frozen=True):
    """The report of `thenar import`: the content of the set, coding losses per joint, conversions, and oddities.

    rests  number of trials in which nothing is held
    """

    table: str
    frames: int
    trials: int
    rests: int
    subjects: int
    objects: int
    grasp_types: int
    taxonomy: str
    switches: int
    taxels: int
    joints: int
    coding: tuple[CodingCost, ...]
    notes: tuple[str, ...]
    warnings: tuple[Oddity, ...]


def import_file(
    table: Path, columns: Path, progress: Report = lambda _done, _total: None, more: Sequence[Path] = ()
) -> tuple[GraspSet, ImportReport]:
    """Import the table in file `table`, or the files that it matches as a pattern, with the columns.toml `columns`.

    Further tables of the same trials are `more`; how their text is written is found. Raises TableError or
    RecordingError naming file, rows and columns, and OSError.
    """
    wanted = read_columns(columns)
    return import_table(read_joined(table, more, progress, wanted)[0], wanted)


def import_table(table: Table, columns: ColumnRoles) -> tuple[GraspSet, ImportReport]:
    """Import `table` with `columns`; raises TableError or RecordingError."""
    table = _renamed(table, columns.rename)
    selection = select(columns, list(table.columns))
    readings, times_us, warnings, notes = read_cells(table, columns, selection)
    table = replace(table, columns={})  # its cells were read: their memory is needed
    grasps, taxonomy, aliases = _labels(table, columns, readings)
    coded = [
        code_joint(name, entry, readings.joints[:, column], readings.rows)
        for column, (name, entry) in enumerate(selection.coded)
    ]
    costs = tuple(cost for _, _, cost in coded)
    count = sum(not isinstance(entry, TaxelColumns) for _, entry in selection.coded)
    joints, taxels = coded[:count], coded[count:]
    empty = np.zeros((len(grasps), 0), np.uint16)
    # Read-only, so that the set uses them without copies.
    for name in readings.__slots__:
        getattr(readings, name).setflags(write=False)
    grasp_set = GraspSet(
        switches=readings.switches,
        switch_names=tuple(name for name, _ in selection.switches),
        codes=np.stack([codes for codes, _, _ in joints], axis=1) if joints else empty,
        joints=tuple(joint for _, joint, _ in joints),
        taxels=np.stack([codes for codes, _, _ in taxels], axis=1) if taxels else empty,
        taxel_columns=tuple(joint for _, joint, _ in taxels),
        grasps=grasps,
        taxonomy=taxonomy,
        subjects=readings.subjects,
        objects=readings.objects,
        trials=readings.trials,
        sessions=readings.sessions,
        independent=columns.frames == "independent",
        times_us=times_us,
        simulated=columns.simulated,
    )
    grasp_set, alike = _trials_by_name(grasp_set, columns)
    warnings += [
        *alike,
        *check_trials(grasp_set, TableError),
        *aliases,
        *coarse(zip(costs, readings.joints.T, strict=True)),
        *find_oddities(grasp_set, readings.rows),
        *possible_clocks(
            zip((name for name, _ in selection.coded), readings.joints.T, strict=True), _course(readings, columns)
        ),
    ]
    if taxels:
        notes.append(
            f"{len(taxels)} taxels stay analog: a placement chooses their levels; to make switches of them, say under "
            '[[taxels]] of the columns.toml above which value they are closed (threshold = 0.4), or threshold = "otsu"'
        )
    return grasp_set, report_of(table.what, grasp_set, costs, warnings, (*table.notes, *notes))


def _trials_by_name(grasp_set: GraspSet, columns: ColumnRoles) -> tuple[GraspSet, list[Oddity]]:
    """Return the set, and a finding where its rows are alike but count as trials all the same: one each, by a column
    whose name says so. Nothing else in them differs from frames.
    """
    named = [name for name in columns.parts("trial") if words_of(name) & WORDS["trial"]]
    alone = len(np.unique(grasp_set.trial_ids)) == len(grasp_set)
    reason = looks_like_frames(grasp_set) if named and alone and not grasp_set.independent else None
    if reason is None:
        return grasp_set, []
    message = (
        f"{reason}: they count as trials, because column {shortened(named[0])} numbers them; the accuracy of frames "
        "would be too high: if they are frames, name the column that numbers whole trials"
    )
    return replace(grasp_set, independent=True), [Oddity("alike trials", len(grasp_set), message)]


def _renamed(table: Table, rename: dict[str, str]) -> Table:
    """Return `table` with other names for some columns. Raises TableError, or RecordingError for a name twice."""
    names = list(table.columns)
    for name in rename:
        if name not in table.columns:
            raise TableError(f"rename: the table has no column {shortened(repr(name))}{nearest(name, names)}")
    names = list((dict(zip(names, names, strict=True)) | rename).values())
    check_names("rename: column", names)
    return replace(table, columns=dict(zip(names, table.columns.values(), strict=True)))


def _course(readings: Readings, columns: ColumnRoles) -> Course:
    """Return the order of the rows, for the search for clocks among the inputs."""
    owner = groups(readings.subjects, readings.sessions)
    group = groups(owner, readings.labels, readings.objects)
    time = None if columns.time is None or not np.isfinite(readings.time).all() else readings.time
    trial_ids = np.arange(len(owner)) if columns.frames == "independent" else groups(group, readings.trials)
    return Course(owner, group, trial_ids, time, columns.time or "")


def report_of(
    table: str,
    grasp_set: GraspSet,
    costs: tuple[CodingCost, ...],
    warnings: Iterable[Oddity],
    notes: Iterable[str] = (),
) -> ImportReport:
    """Return the report on `grasp_set`, which was imported from `table`."""
    return ImportReport(
        table=table,
        frames=len(grasp_set),
        trials=grasp_set.n_trials,
        rests=grasp_set.rests,
        subjects=len(np.unique(grasp_set.subjects)),
        objects=len(np.unique(grasp_set.objects)),
        grasp_types=len(np.unique(grasp_set.labels[~grasp_set.is_none])),
        taxonomy=grasp_set.taxonomy.name,
        switches=len(grasp_set.switch_names),
        taxels=len(grasp_set.taxel_columns),
        joints=len(grasp_set.joints),
        coding=costs,
        notes=tuple(notes),
        warnings=tuple(warnings),
    )


def _labels(table: Table, columns: ColumnRoles, readings: Readings) -> tuple[NDArray[np.str_], Taxonomy, list[Oddity]]:
    """Return each row's grasp type, the taxonomy, and a finding about unused aliases."""
    labels, where = np.unique(readings.labels, return_inverse=True)
    if len(labels) > TYPES:
        raise TableError(
            f"{table.what}: column {shortened(repr(columns.label))} holds {len(labels)} different labels, "
            f"more than {TYPES}: is it the label?"
        )
    none = nothing_held(columns, labels).tolist()
    aliased = meanings(columns, labels.tolist())
    taxonomy = _taxonomy(columns, [label for label, nothing in zip(aliased, none, strict=True) if not nothing])
    find = taxonomy.finder()
    types = [NONE if nothing else find(label) for label, nothing in zip(aliased, none, strict=True)]
    unknown = np.array([name is None for name in types])[where]
    if unknown.any():
        names = [label for label, name in zip(aliased, types, strict=True) if name is None]
        raise TableError(
            f"{table.what}: {len(names)} labels in {shortened(repr(columns.label))} are not grasp types of "
            f"{taxonomy.name}: {_unknown(names, taxonomy)}; {unknown.sum()} rows have them, "
            f"{list_rows(readings.rows[unknown])}; [labels] can translate them"
        )
    unused = sorted(columns.labels.keys() - {*labels.tolist()} - {*map(whole, labels.tolist())})
    meant = {*map(plain, (*labels.tolist(), *aliased))}
    unused += [label for label in columns.parts("none") if plain(label) not in meant]
    message = f"{len(unused)} entries of [labels] and `none` occur in no row: {list_names(unused)}"
    check_room(len(where), max(map(len, filter(None, types))), table.size)
    return (
        np.array(types, np.str_)[where],
        taxonomy,
        [Oddity("unused aliases", len(unused), message)] if unused else [],
    )


# Number of labels named in a message, and of those shown with suggestions.
_NAMED, _SUGGESTED = 30, 3


def _unknown(labels: list[str], taxonomy: Taxonomy) -> str:
    """Return the labels that are not grasp types, as many as fit a message, the first with suggestions."""
    long = len(labels) > _SUGGESTED
    shown = [f"{shortened(repr(label))}{taxonomy.suggestion(label)}" for label in labels[:_SUGGESTED]]
    room, rest = 400, labels[_SUGGESTED:_NAMED]
    for label in rest if long else ():
        room -= len(shortened(repr(label)))
        if room < 0:
            break
        shown.append(shortened(repr(label)))
    more = len(labels) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")


def _taxonomy(columns: ColumnRoles, labels: list[str]) -> Taxonomy:
    try:
        if isinstance(columns.taxonomy, tuple):
            return own(columns.taxonomy)
        if isinstance(columns.taxonomy, dict):
            ((name, types),) = columns.taxonomy.items()
            return Taxonomy(name, types)
        return own(sorted(set(labels))) if columns.taxonomy == "own" else published(columns.taxonomy)
    except RecordingError as reason:
        raise TableError(f"taxonomy: {reason}") from reason


# The second point of a grid's straight line: so far out that its step equals the grid within a bit or two.
_FAR = 1000


def code_joint(
    name: str, entry: JointColumns, values: NDArray[np.float64], rows: NDArray[np.int64]
) -> tuple[NDArray[np.uint16], Joint, CodingCost]:
    """Return the codes (n,) of one column of finite `values` (n,), their calibration, and their cost.

    Raises TableError naming the first of `rows` whose code lies outside 0..65535; RecordingError if the calibration is
    not a straight line.
    """
    if isinstance(entry, TaxelColumns) and not entry.is_coded:
        whole = bool((values == np.rint(values)).all()) and values.min() >= 0 and values.max() < CODES
        entry = structs.replace(entry, codes=True) if whole else structs.replace(entry, grid=sound_grid(values))
    joint = _joint(name, entry, values)
    if isinstance(entry, TaxelColumns) and entry.bits is not None:
        # Calibrated at the ends of the converter's range.
        least, most = joint.value([0, top := 2**entry.bits - 1]).tolist()
        joint = Joint(joint.name, joint.unit, 0, least, top, most)
        if (beyond := values > joint.code_b).any():
            raise TableError(f"taxel {name!r}: {list_rows(rows[beyond])} exceed {entry.bits} bits: say how many it has")
    codes = values if entry.is_counts else joint.code(values)
    outside = (codes < 0) | (codes >= CODES)
    if outside.any():
        cause = "check origin and calibration" if (codes < 0).any() else "take a coarser grid"
        raise TableError(f"joint {name!r}: {list_rows(rows[outside])} would get codes outside 0..{CODES - 1}: {cause}")
    errors = np.zeros(1) if entry.is_counts else np.abs(joint.value(codes) - values)
    step = abs(joint.step)
    cost = CodingCost(
        joint=name,
        unit=joint.unit,
        step=step,
        largest_error=float(errors.max()),
        distinct_before=len(np.unique(values)),
        distinct_after=len(np.unique(codes)),
    )
    return codes.astype(np.uint16), joint, cost


def _joint(name: str, entry: JointColumns, values: NDArray[np.float64]) -> Joint:
    if entry.calibration is not None:
        points = entry.calibration
        return Joint(name, entry.unit, points.code_a, points.value_a, points.code_b, points.value_b)
    if entry.is_counts:
        return Joint(name, entry.unit, 0, 0.0, 1, 1.0)
    steps = float(values.min()) / entry.step
    # If the grid is too fine to count, a Joint cannot have it either.
    floor = math.floor(steps) * entry.step if math.isfinite(steps) else float(values.min())
    origin = floor if entry.origin is None else entry.origin
    return Joint(name, entry.unit, 0, origin, _FAR, origin + _FAR * entry.step)


# Joints with more values than the first number and fewer codes than the second have lost information.
_MANY, _FEW = 20, 10


def coarse(coded: Iterable[tuple[CodingCost, NDArray[np.float64]]]) -> list[Oddity]:
    """Return a finding about the joints that lost most of their distinct values, given costs and values."""
    lost = [
        (cost, sound_grid(values))
        for cost, values in coded
        if cost.distinct_before >= _MANY and cost.distinct_after < _FEW
    ]
    if not lost:
        return []
    shown = [
        f"{cost.joint} {cost.distinct_after} of {cost.distinct_before} (grid = {grid:g} keeps them)"
        for cost, grid in lost
    ]
    message = f"{len(lost)} joints keep few of their values on their grid: {list_names(shown)}"
    return [Oddity("coarse grids", len(lost), message, columns=tuple(cost.joint for cost, _ in lost))]
