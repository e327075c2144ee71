"""A table and its columns.toml into a `GraspSet`, and a report of what was found, and what coding cost, on the way."""

import math
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import list_names, shortened

from .cells import Readings, read_cells
from .columns import Columns, JointColumns, read_columns, select
from .errors import TYPES, ColumnsError, RecordingError, TableError, check_room, list_rows
from .graspset import CODES, GraspSet, Joint
from .summary import Finding, find_oddities
from .table import Table, read_table
from .taxonomy import Taxonomy, own, published

# Where the second point of a grid's straight line lies: so far out that its step is the grid to a bit or two.
_FAR = 1000


class CodingCost(msgspec.Struct, frozen=True):
    """What coding one joint lost: errors in `unit`, distinct values before and after."""

    joint: str
    unit: str
    step: float
    largest_error: float
    rms_error: float
    distinct_before: int
    distinct_after: int


def code_joint(
    name: str, entry: JointColumns, values: NDArray[np.float64], rows: NDArray[np.int64]
) -> tuple[NDArray[np.uint16], Joint, CodingCost]:
    """Return the codes (n,) of one column of finite `values` (n,), their calibration, and their cost.

    Raises TableError naming the first of `rows` whose code lies outside 0..65535; RecordingError if the calibration is
    no straight line.
    """
    joint = _joint(name, entry, float(values.min()))
    codes = values if entry.codes else joint.code(values)
    outside = (codes < 0) | (codes >= CODES)
    if outside.any():
        cause = "check origin and calibration" if (codes < 0).any() else "take a coarser grid"
        raise TableError(f"joint {name!r}: {list_rows(rows[outside])} would get codes outside 0..{CODES - 1}: {cause}")
    errors = np.zeros(1) if entry.codes else np.abs(joint.value(codes) - values)
    step = abs(joint.step)
    cost = CodingCost(
        joint=name,
        unit=joint.unit,
        step=step,
        largest_error=float(errors.max()),
        # In steps, whose squares are neither too large nor too small for a double.
        rms_error=math.sqrt(float(np.mean((errors / step) ** 2))) * step,
        distinct_before=len(np.unique(values)),
        distinct_after=len(np.unique(codes)),
    )
    return codes.astype(np.uint16), joint, cost


def _joint(name: str, entry: JointColumns, least: float) -> Joint:
    if entry.calibration is not None:
        points = entry.calibration
        return Joint(name, entry.unit, points.code_a, points.value_a, points.code_b, points.value_b)
    if entry.codes:
        return Joint(name, entry.unit, 0, 0.0, 1, 1.0)
    steps = least / entry.step
    # Where the grid cannot be counted, no Joint will have it either.
    floor = math.floor(steps) * entry.step if math.isfinite(steps) else least
    origin = floor if entry.origin is None else entry.origin
    return Joint(name, entry.unit, 0, origin, _FAR, origin + _FAR * entry.step)


class ImportReport(msgspec.Struct, frozen=True):
    """What `thenar import` says: what is in the set, what coding cost per joint, and what is odd."""

    table: str
    rows: int
    subjects: int
    objects: int
    grasp_types: int
    taxonomy: str
    switches: int
    joints: int
    coding: tuple[CodingCost, ...]
    warnings: tuple[Finding, ...]


def import_file(table: Path, columns: Path) -> tuple[GraspSet, ImportReport]:
    """Import the table in file `table` as the columns.toml in file `columns` says.

    Raises TableError, ColumnsError or RecordingError, naming file, rows and columns; OSError as it comes.
    """
    wanted = read_columns(columns)
    return import_table(read_table(table, wanted.delimiter), wanted)


def import_table(table: Table, columns: Columns) -> tuple[GraspSet, ImportReport]:
    """Import `table` as `columns` says; raises TableError, ColumnsError or RecordingError."""
    selection = select(columns, list(table.columns))
    readings, dropped = read_cells(table, columns, selection)
    grasps, taxonomy, aliases = _labels(table, columns, readings)
    joints = [
        code_joint(name, entry, readings.joints[:, column], readings.rows)
        for column, (name, entry) in enumerate(selection.joints)
    ]
    empty = np.zeros((len(grasps), 0), np.uint16)
    grasp_set = GraspSet(
        switches=readings.switches,
        switch_names=selection.switches,
        codes=np.stack([codes for codes, _, _ in joints], axis=1) if joints else empty,
        joints=tuple(joint for _, joint, _ in joints),
        grasps=grasps,
        taxonomy=taxonomy,
        subjects=readings.subjects,
        objects=readings.objects,
        trials=readings.trials,
    )
    warnings = (*dropped, *aliases, *find_oddities(grasp_set, readings.rows))
    return grasp_set, report_of(table.what, grasp_set, tuple(cost for _, _, cost in joints), warnings)


def report_of(
    what: str, grasp_set: GraspSet, coding: tuple[CodingCost, ...], warnings: tuple[Finding, ...]
) -> ImportReport:
    """Return what is to be said of `grasp_set`, which was imported from `what`."""
    return ImportReport(
        table=what,
        rows=len(grasp_set),
        subjects=len(np.unique(grasp_set.subjects)),
        objects=len(np.unique(grasp_set.objects)),
        grasp_types=len(np.unique(grasp_set.labels)),
        taxonomy=grasp_set.taxonomy.name,
        switches=len(grasp_set.switch_names),
        joints=len(grasp_set.joints),
        coding=coding,
        warnings=warnings,
    )


def _labels(table: Table, columns: Columns, readings: Readings) -> tuple[NDArray[np.str_], Taxonomy, list[Finding]]:
    """Return each row's grasp type, the taxonomy, and the aliases that nobody needed."""
    found, where = np.unique(readings.labels, return_inverse=True)
    if len(found) > TYPES:
        raise TableError(
            f"{table.what}: column {shortened(repr(columns.label))} holds {len(found)} different labels, "
            f"more than {TYPES}: is it the label?"
        )
    aliased = [columns.labels.get(label, label) for label in found.tolist()]
    taxonomy = _taxonomy(columns, aliased)
    find = taxonomy.finder()
    types = [find(label) for label in aliased]
    unknown = np.array([name is None for name in types])[where]
    if unknown.any():
        label = aliased[where[np.flatnonzero(unknown)[0]]]
        raise TableError(
            f"{table.what}: {unknown.sum()} unknown labels in {shortened(repr(columns.label))}, "
            f"{list_rows(readings.rows[unknown])}; "
            f"{shortened(repr(label))} is no grasp type of {taxonomy.name}{taxonomy.suggestion(label)}; "
            "[labels] can translate it"
        )
    unused = sorted(columns.labels.keys() - set(found.tolist()))
    message = f"{len(unused)} entries of [labels] occur in no row: {list_names(unused)}"
    check_room(len(where), max(map(len, filter(None, types))), table.size)
    return (
        np.array(types, np.str_)[where],
        taxonomy,
        [Finding("unused aliases", len(unused), message)] if unused else [],
    )


def _taxonomy(columns: Columns, labels: list[str]) -> Taxonomy:
    try:
        if isinstance(columns.taxonomy, tuple):
            return own(columns.taxonomy)
        return own(sorted(set(labels))) if columns.taxonomy == "own" else published(columns.taxonomy)
    except RecordingError as reason:
        raise ColumnsError(f"taxonomy: {reason}") from reason
