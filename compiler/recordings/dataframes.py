"""Convert a pandas DataFrame to a `GraspSet`; export.py has the other direction."""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thenar.runtime.names import shortened
from thenar.runtime.toml_source import TomlText
from thenar.runtime.toml_struct import convert

from .clocks import POSSIBLE_CLOCKS
from .columns import ColumnRoles, read_columns
from .errors import ColumnsError, TableError, check_names
from .export import COLUMNS_TOML
from .graspset import GraspSet
from .importer import import_table
from .propose import propose
from .table import Column, Table, unlisted

if TYPE_CHECKING:
    import pandas as pd

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
    TableError, ColumnsError, RecordingError
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
    if columns is None:
        columns = _said(frame) or _proposed(table)
    grasp_set, report = import_table(
        table, columns if isinstance(columns, ColumnRoles) else read_columns(Path(columns))
    )
    for finding in report.warnings:
        if finding.kind == POSSIBLE_CLOCKS:
            warnings.warn(finding.message, stacklevel=2)
    return grasp_set


def _said(frame: "pd.DataFrame") -> ColumnRoles | None:
    """Return the columns that a frame describes in its attributes."""
    text = frame.attrs.get(COLUMNS_TOML)
    if not isinstance(text, str):
        return None
    source = TomlText(f"attrs[{COLUMNS_TOML!r}] of {_WHAT}", text, ColumnsError)
    return convert(source, (), source.tables(), ColumnRoles)


def _proposed(table: Table) -> ColumnRoles:
    proposal = propose(table)
    if proposal.lacks:
        raise ColumnsError(
            f"{_WHAT}: {proposal.lacks}; say so in `columns`: a ColumnRoles, or the path of a columns.toml"
        )
    return proposal.columns


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
