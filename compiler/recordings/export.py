"""Export a `GraspSet` as a table or DataFrame, with the columns.toml, and import a DataFrame."""

import csv
import glob
import gzip
import io
import re
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.extras import optional
from thenar.runtime.files import write_atomically
from thenar.runtime.names import shortened
from thenar.runtime.toml_source import TomlText
from thenar.runtime.toml_struct import convert

from ..text import cell, cells
from . import TableError, check_names
from .cells import Column, unlisted
from .columns import KEYS, CalibrationPoints, ColumnRoles, JointColumns, TaxelColumns, read_columns
from .graspset import GraspSet, Joint
from .importer import import_table
from .inputs import POSSIBLE_CLOCKS
from .propose import propose
from .table import Table
from .taxonomy import is_published

if TYPE_CHECKING:
    import pandas as pd


def heads_of(grasp_set: GraspSet) -> dict[str, str]:
    """Return the names of the exported columns other than inputs, by their keys in a columns.toml.

    They are "grasp", "subject", "object", "session", "trial" and "time_us", with an underscore appended where an input
    has that name.
    """
    inputs = {*grasp_set.element_names, *grasp_set.joint_names}
    heads = dict(zip(KEYS, ("grasp", *KEYS[1:-1], "time_us"), strict=True))
    for key in heads:
        while heads[key] in inputs:
            heads[key] += "_"
    return heads


def meta_of(grasp_set: GraspSet) -> dict[str, NDArray[np.generic]]:
    """Return the columns other than inputs and label, by their keys in a columns.toml.

    There is a session only if the set has several, a time only if it is known, and a trial only if rows are not
    independent.
    """
    found = {key: getattr(grasp_set, f"{key}s" if key != "time" else "times_us") for key in KEYS[1:]}
    absent = {"time"} if not grasp_set.times_us.size else set()
    absent |= {"trial"} if grasp_set.independent else set()
    absent |= {"session"} if not (grasp_set.sessions != "1").any() else set()
    return {key: column for key, column in found.items() if key not in absent}


def types_of(grasp_set: GraspSet) -> tuple[str, ...]:
    """Return the grasp types of the taxonomy, followed by "none" if it occurs."""
    return grasp_set.taxonomy.names if grasp_set.is_none.any() else grasp_set.taxonomy.types


def columns_of(grasp_set: GraspSet, codes: bool = False) -> str:
    """Return the text of the columns.toml that imports the exported table again; `codes` as in `export`."""
    heads, taxonomy = heads_of(grasp_set), grasp_set.taxonomy
    types = taxonomy.types if taxonomy.name == "own" else {taxonomy.name: taxonomy.types}
    roles = ColumnRoles(
        label=heads["label"],
        **{key: heads[key] for key in meta_of(grasp_set)},  # type: ignore[arg-type]
        time_unit="us" if grasp_set.times_us.size else None,
        frames="independent" if grasp_set.independent else None,
        simulated=grasp_set.simulated,
        taxonomy=taxonomy.name if is_published(taxonomy) else types,
        switches=tuple(map(glob.escape, grasp_set.switch_names)),
        joints=_entries(JointColumns, grasp_set.joints, codes),
        taxels=_entries(TaxelColumns, grasp_set.taxel_columns, codes),
    )
    return roles.toml()


_Entry = TypeVar("_Entry", JointColumns, TaxelColumns)


def _entries(kind: type[_Entry], joints: Iterable[Joint], codes: bool) -> tuple[_Entry, ...]:
    """Return an entry for neighbours with the same calibration: their order is the order of the codes."""
    alike = (list(group) for _, group in groupby(joints, key=lambda joint: replace(joint, name="any")))
    return tuple(
        kind(
            tuple(glob.escape(joint.name) for joint in group),
            unit=group[0].unit,
            codes=codes,
            calibration=CalibrationPoints(group[0].code_a, group[0].value_a, group[0].code_b, group[0].value_b),
        )
        for group in alike
    )


# The formats of an export.
SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".arff", ".parquet")
# The key in a DataFrame's `attrs` for the text of the columns.toml that makes it a set again.
COLUMNS_TOML = "thenar"
# Names that Weka reads without quotes; it quotes all others.
_BARE = re.compile(r"[A-Za-z0-9_.+-]+")


def export(grasp_set: GraspSet, path: Path, codes: bool = False, columns: Path | None = None) -> None:
    """Write `grasp_set` to a file with one of SUFFIXES, completely or not at all; joints as values, or as `codes`.

    `columns` is the file for the columns.toml that imports the table again, unless it is ARFF, which holds the inputs
    and the grasp type alone. Raises TableError for any other suffix.
    """
    name = path.name.lower()
    if name.endswith(".arff"):
        data = to_arff(grasp_set, codes).encode()
    elif name.endswith(".parquet"):
        data = to_dataframe(grasp_set, codes).to_parquet(index=False)
    elif name.removesuffix(".gz").endswith((".csv", ".tsv")):
        text = to_csv(grasp_set, codes, "\t" if name.removesuffix(".gz").endswith(".tsv") else ",")
        data = gzip.compress(text.encode(), mtime=0) if name.endswith(".gz") else text.encode()
    else:
        raise TableError(f"{path.name}: an exported table ends in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}")
    write_atomically(path, data)
    if columns is not None:
        write_atomically(columns, columns_of(grasp_set, codes).encode())


def to_csv(grasp_set: GraspSet, codes: bool = False, delimiter: str = ",") -> str:
    """Return grasp type, subject, object, trial, time, switches and joints as CSV with one header row.

    A name that a spreadsheet would read as a formula gets an apostrophe in front, which the import removes.
    """
    file, heads, meta = io.StringIO(), heads_of(grasp_set), meta_of(grasp_set)
    writer = csv.writer(file, delimiter=delimiter, lineterminator="\n")
    names = (heads["label"], *(heads[key] for key in meta), *grasp_set.element_names, *grasp_set.joint_names)
    writer.writerow(map(cell, names))
    who = (cells(column.tolist()) for column in (grasp_set.grasps, *meta.values()))
    writer.writerows(zip(*who, *_inputs(grasp_set, codes), strict=True))
    return file.getvalue()


def to_dataframe(grasp_set: GraspSet, codes: bool = False) -> "pd.DataFrame":
    """Return a set as a pandas DataFrame, from which `from_dataframe` restores the same set.

    Parameters
    ----------
    grasp_set : GraspSet
        The set.
    codes : bool
        Give the integer codes (uint16) of joints and taxels instead of their values (float64).

    Returns
    -------
    pandas.DataFrame
        One row per frame: "grasp" (a category of the taxonomy's types, in order, and "none" if it occurs), "subject"
        and "object" (str), "session" (str; only if there are several), "trial" (int64), "time_us" (int64; if known),
        the switches (bool), taxels and joints, in the set's order. If an input has one of these names, an underscore is
        appended to the column. `attrs["thenar"]` is the text of a columns.toml: roles, calibrations, taxonomy, and the
        simulator of the grasps. Parquet keeps it.

    Raises
    ------
    MissingPackageError
        If pandas is not installed.

    Examples
    --------
    >>> to_dataframe(grasp_set).groupby("subject")["grasp"].value_counts()  # doctest: +SKIP
    """
    with optional():
        import pandas as pd

    heads = heads_of(grasp_set)
    columns: dict[str, object] = {
        heads["label"]: pd.Categorical.from_codes(grasp_set.labels, categories=list(types_of(grasp_set))),
        **{heads[key]: column for key, column in meta_of(grasp_set).items()},
        **dict(zip(grasp_set.switch_names, grasp_set.switches.T, strict=True)),
    }
    for joint, column in _coded(grasp_set):
        columns[joint.name] = column if codes else joint.value(column)
    frame = pd.DataFrame(columns)
    frame.attrs[COLUMNS_TOML] = columns_of(grasp_set, codes)
    return frame


def to_arff(grasp_set: GraspSet, codes: bool = False) -> str:
    """Return the set as ARFF: switches nominal {0,1}, joints numeric, the grasp type nominal and last."""
    attributes = [f"{_quote(name)} {{0,1}}" for name in grasp_set.switch_names]
    attributes += [f"{_quote(joint.name)} numeric" for joint, _ in _coded(grasp_set)]
    types = ",".join(map(_quote, types_of(grasp_set)))
    attributes.append(f"{_quote(heads_of(grasp_set)['label'])} {{{types}}}")
    rows = zip(*_inputs(grasp_set, codes), map(_quote, grasp_set.grasps.tolist()), strict=True)
    lines = ["@relation grasps", "", *(f"@attribute {attribute}" for attribute in attributes), "", "@data"]
    return "\n".join([*lines, *map(",".join, rows), ""])


def _inputs(grasp_set: GraspSet, codes: bool) -> Iterable[Sequence[str]]:
    """Yield the cells of each switch, taxel and joint."""
    for switch in grasp_set.switches.T:
        yield ["1" if bit else "0" for bit in switch.tolist()]
    for joint, column in _coded(grasp_set):
        # Twelve digits distinguish any two codes of a Joint, and hide the last bits of the arithmetic.
        yield list(map(str, column.tolist())) if codes else [f"{value:.12g}" for value in joint.value(column).tolist()]


def _coded(grasp_set: GraspSet) -> Iterable[tuple[Joint, NDArray[np.uint16]]]:
    """Yield the taxels and then the joints, each with its codes (n,)."""
    yield from zip(grasp_set.taxel_columns, grasp_set.taxels.T, strict=True)
    yield from zip(grasp_set.joints, grasp_set.codes.T, strict=True)


def _quote(name: str) -> str:
    """Return `name` as ARFF writes it, quoted like Weka if necessary."""
    return name if _BARE.fullmatch(name) else "'" + re.sub(r"([\\'\"%])", r"\\\1", name) + "'"


_WHAT = "the DataFrame"


def from_dataframe(frame: "pd.DataFrame", columns: ColumnRoles | str | Path | None = None) -> GraspSet:
    """Return the set in a DataFrame with one row per frame; its index is ignored.

    Parameters
    ----------
    frame : pandas.DataFrame
        Any dtypes: switches are bool, or 0 and 1; joints are numbers; names are text, numbers or categories. NaN, None
        and NA are missing values.
    columns : ColumnRoles, str or Path, optional
        The roles of the columns: `thenar.compiler.ColumnRoles`, or the path of a columns.toml. A frame from
        `to_dataframe` has them in its `attrs`; for any other they are guessed from names and values, as by `thenar
        import`.

    Raises
    ------
    TableError, RecordingError
        As for an import of the same table; the message names rows, as counted by `iloc`, and columns.

    Examples
    --------
    >>> import pandas as pd
    >>> from thenar.compiler import ColumnRoles, from_dataframe
    >>> frame = pd.DataFrame({"grasp": ["pinch", "hook"], "thumb": [True, False], "n": [1, 2]})
    >>> from_dataframe(frame, ColumnRoles(label="grasp", switches=("thumb",), trial="n"))
    GraspSet: 2 trials of 2 frames, 2 grasp types (own), 1 switches, 0 joints, 1 subjects, 1 objects
    """
    table = table_of(frame)
    roles = columns if isinstance(columns, ColumnRoles) else None
    if columns is None and (roles := _said(frame)) is None:
        proposal = propose(table)
        if proposal.lacks:
            advice = "say so in `columns`: a ColumnRoles, or the path of a columns.toml"
            raise TableError(f"{_WHAT}: {proposal.lacks}; {advice}")
        roles = proposal.columns
    grasp_set, report = import_table(table, roles or read_columns(Path(columns)))  # type: ignore[arg-type]
    for finding in report.warnings:
        if finding.kind == POSSIBLE_CLOCKS:
            warnings.warn(finding.message, stacklevel=2)
    return grasp_set


def _said(frame: "pd.DataFrame") -> ColumnRoles | None:
    """Return the columns that a frame describes in its attributes."""
    text = frame.attrs.get(COLUMNS_TOML)
    if not isinstance(text, str):
        return None
    source = TomlText(f"attrs[{COLUMNS_TOML!r}] of {_WHAT}", text, TableError)
    return convert(source, (), source.tables(), ColumnRoles)


def table_of(frame: "pd.DataFrame") -> Table:
    """Return the table in a DataFrame, with rows counted from 0, as in `iloc`. The index is ignored.

    Raises TableError if it has no rows, or duplicate column names.
    """
    if not len(frame):
        raise TableError(f"{_WHAT} has no rows")
    names = [str(name).strip() for name in frame.columns]
    check_names(f"{_WHAT}: column", names)
    rows = np.arange(len(frame))
    columns = {name: _column(frame.iloc[:, number], name) for number, name in enumerate(names)}
    return Table(_WHAT, unlisted(_WHAT, columns, rows), rows, size=int(frame.memory_usage(deep=True).sum()))


def _column(series: "pd.Series", name: str) -> Column:
    """Return numbers and bits as float64, NaN if missing, and everything else as text, empty if missing."""
    from pandas.api.types import is_complex_dtype, is_numeric_dtype

    if is_complex_dtype(series):
        raise TableError(f"{_WHAT}: column {shortened(repr(name))} holds complex numbers: split or drop it")
    if is_numeric_dtype(series):
        return series.to_numpy(np.float64, na_value=np.nan)  # type: ignore[no-any-return]
    # An array's own text is rounded.
    plain = (value.tolist() if isinstance(value, np.ndarray) else value for value in series)
    return ["" if gone else str(value) for value, gone in zip(plain, series.isna(), strict=True)]
