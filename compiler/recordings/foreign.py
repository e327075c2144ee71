"""Tables of other programs: spreadsheets, Parquet, HDF5 and MATLAB files, read by their libraries.

They are read in a process with limits on memory and processor time, and returned as npz: so a file that claims a
terabyte, or that crashes a library, ends in an error message. Nothing is unpickled; links to other files are not
followed.
"""

import os
import resource
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.extras import missing
from thenar.runtime.names import list_names, shortened

from .arrays import AnyArray, read_arrays
from .errors import COLUMNS, LARGEST, ROWS, TableError

# Bytes of memory that reading may take in addition to the libraries: a constant, and a factor per byte of the file.
MEMORY, MEMORY_EACH = 600_000_000, 20
# Seconds of processor time: a constant, and the number of bytes that add a second.
CPU_S, CPU_BYTES = 60, 200_000
# The exit code of the child if its output says why a file is rejected.
_REFUSED = 3

Columns = dict[str, AnyArray]


def read_foreign(path: Path) -> tuple[Columns, NDArray[np.int64]]:
    """Return the columns of a foreign table, text or numbers, and the numbers of its rows as the user sees them.

    Raises TableError with the reason.
    """
    if path.stat().st_size > LARGEST:
        raise TableError(f"{path.name} is larger than {LARGEST} bytes, the most that is read of a table")
    with TemporaryDirectory() as folder:
        made = Path(folder) / "columns.npz"
        command = [sys.executable, "-P", "-m", __name__, str(path.absolute()), str(made)]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
        if done.returncode == _REFUSED:
            raise TableError(f"{path.name}: {shortened(done.stdout.decode(errors='replace').strip(), 600)}")
        if done.returncode:
            cause = "took too long" if done.returncode == -signal.SIGXCPU else "gave up"
            raise TableError(
                f"{path.name}: its reader {cause}: the file is damaged, or larger inside than is read: save it as CSV"
            )
        columns = read_arrays(made)
    names, rows = columns.pop("names"), columns.pop("rows")
    return {str(name): columns[str(number)] for number, name in enumerate(names)}, rows.astype(np.int64)


def _spreadsheet(path: Path) -> tuple[Columns, Sequence[int]]:
    from python_calamine import load_workbook

    book = load_workbook(path)
    sheets = (
        book.get_sheet_by_index(number).to_python(skip_empty_area=False) for number in range(len(book.sheet_names))
    )
    cells = next((sheet for sheet in sheets if any(cell != "" for row in sheet for cell in row)), [])
    filled = [number for number, row in enumerate(cells) if any(cell != "" for cell in row)]
    if not filled:
        raise TableError("it holds no sheet with cells")
    head = [_text(cell) for cell in cells[filled[0]]]
    body = filled[1:]
    columns: Columns = {}
    for place, name in enumerate(head):
        column = [cells[row][place] for row in body]
        if name or any(cell != "" for cell in column):
            _add(columns, name or f"column {place + 1}", _array(column))
    return columns, [row + 1 for row in body]


def _parquet(path: Path) -> tuple[Columns, Sequence[int]]:
    import pyarrow
    from pyarrow import parquet

    pyarrow.set_memory_pool(pyarrow.system_memory_pool())
    with parquet.ParquetFile(path) as file:
        _check(file.metadata.num_rows, file.metadata.num_columns)
        table = file.read(use_threads=False)
    columns: Columns = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        kind = column.type
        if pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind) or pyarrow.types.is_boolean(kind):
            array = column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
        else:
            array = _array(column.to_pylist())
        _add(columns, name, array)
    return columns, range(1, table.num_rows + 1)


def _hdf5(path: Path) -> tuple[Columns, Sequence[int]]:
    import h5py

    found: Columns = {}
    with h5py.File(path, "r", locking=False) as file:
        matlab = path.suffix.lower() == ".mat"

        def visit(name: str, item: object) -> None:
            if not isinstance(item, h5py.Dataset) or name.startswith("#") or not 1 <= item.ndim <= 2:
                return
            if item.external or item.is_virtual:
                raise TableError(f"{shortened(repr(name))} lies in another file: copy it into this one")
            if (array := _dataset(file, item, matlab)) is not None:
                found[name] = array

        file.visititems(visit)
    return _even(found)


def _dataset(file: Any, item: Any, matlab: bool) -> AnyArray | None:
    """Return a dataset's content if it is numbers, text, records of them, or a MATLAB cell array with text."""
    import h5py

    _check(max(item.shape) if matlab else item.shape[0], min(item.shape) if matlab else 1)
    if h5py.check_string_dtype(item.dtype):
        return item[()] if item.dtype.kind == "S" else np.array(item.asstr("utf-8", "replace")[()], np.str_)
    kind = item.attrs.get("MATLAB_class", b"")
    if kind == b"cell" and h5py.check_ref_dtype(item.dtype):
        return _array([_letters(file[reference][()]) for reference in item[()].ravel()])
    if kind == b"char":
        return np.array([_letters(row) for row in np.atleast_2d(item[()].T)])
    if item.dtype.kind not in "biufSV" or h5py.check_vlen_dtype(item.dtype):
        return None
    array: AnyArray = item[()]
    return array.T if matlab else array


def _letters(codes: Any) -> str:
    """Return a MATLAB text, an array of UTF-16."""
    return bytes(np.asarray(codes, "<u2").ravel(order="F").tobytes()).decode("utf-16-le").rstrip()


def _matlab(path: Path) -> tuple[Columns, Sequence[int]]:
    from scipy.io import loadmat

    with path.open("rb") as file:
        opening = file.read(128)
    if b"MATLAB 7.3" in opening:
        return _hdf5(path)
    found = loadmat(path, squeeze_me=False, chars_as_strings=True)
    return _even(
        {
            name: array
            for name, value in found.items()
            if not name.startswith("__")
            for name, array in _fields(name, value)
        }
    )


def _fields(name: str, value: Any) -> Iterator[tuple[str, AnyArray]]:
    """Yield the columns in a MATLAB variable: an array, a cell array, or a structure of them."""
    if not isinstance(value, np.ndarray):
        raise TableError(f"variable {shortened(repr(name))} is not an array: save each column of a table as an array")
    if value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _fields(field, value.ravel()[0][field])
    elif value.dtype == object:
        yield name, _array([_cell(each) for each in value.ravel()])
    elif value.dtype.kind in "biufU":
        yield name, value


def _cell(value: Any) -> object:
    array = np.asarray(value)
    return "" if not array.size else array.ravel()[0].item() if array.size == 1 else str(value)


def _even(found: Mapping[str, AnyArray]) -> tuple[Columns, Sequence[int]]:
    """Return the arrays as columns; those with one element are left out if others have more."""
    columns: Columns = {}
    for name, array in found.items():
        if array.dtype.names:
            for field in array.dtype.names:
                records: Any = array.reshape(-1)
                columns |= _columns(f"{name}.{field}", records[field])
        else:
            columns |= _columns(name, array)
    lengths = Counter(len(column) for column in columns.values())
    if len(lengths) > 1:
        del lengths[1]
    if len(lengths) > 1:
        raise TableError(f"its arrays have unequal lengths, {list_names(list(map(str, sorted(lengths))))}")
    rows = next(iter(lengths), 0)
    made: Columns = {}
    for name, column in columns.items():
        if len(column) == rows:
            _add(made, name, column)
    return made, range(1, rows + 1)


def _columns(name: str, array: AnyArray) -> Columns:
    """Return an array as columns called by its name, or by its name and a number."""
    if array.dtype.kind == "V" or array.ndim > 2:
        return {}
    if array.dtype.kind == "S":
        array = np.char.decode(array.astype(np.bytes_), "utf-8", "replace")
    if array.ndim == 1 or 1 in array.shape:
        return {name: array.reshape(-1)}
    return {f"{name}.{number}": array[:, number] for number in range(array.shape[1])}


def _array(cells: list[Any]) -> AnyArray:
    """Return cells as numbers, with NaN for empty ones, or as text."""
    if all(cell is None or cell == "" or isinstance(cell, (int, float)) for cell in cells):
        return np.array([np.nan if cell is None or cell == "" else cell for cell in cells], np.float64)
    if cells and all(isinstance(cell, (list, tuple)) for cell in cells):
        return np.array(cells, np.float64)
    return np.array([_text(cell) for cell in cells], np.str_)


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, float) and cell.is_integer():
        return str(int(cell))
    return str(cell).strip()


def _add(columns: Columns, name: str, array: AnyArray) -> None:
    for each, column in _columns(name, array).items():
        if each in columns:
            raise TableError(f"two columns are called {shortened(repr(each))}: rename one")
        columns[each] = column
    _check(len(array), len(columns))


def _check(rows: int, columns: int) -> None:
    if rows > ROWS or columns > COLUMNS:
        raise TableError(f"it has more than {ROWS} rows or {COLUMNS} columns, the most that are read of a table")


# By suffix: the kind of file, its package, and its reader.
READERS: dict[str, tuple[str, str, Callable[[Path], tuple[Columns, Sequence[int]]]]] = {
    **dict.fromkeys((".xlsx", ".xls", ".ods"), ("a spreadsheet", "python_calamine", _spreadsheet)),
    ".parquet": ("Parquet", "pyarrow.parquet", _parquet),
    **dict.fromkeys((".h5", ".hdf5"), ("HDF5", "h5py", _hdf5)),
    ".mat": ("a MATLAB file", "scipy.io", _matlab),
}


def _limit(size: int) -> None:
    """Limit the additional memory and the processor time of this process."""
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S + size // CPU_BYTES,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    status = Path("/proc/self/statm")
    if status.exists():
        taken = int(status.read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY + MEMORY_EACH * size,) * 2)


def main(source: str, target: str) -> int:
    """Read the table in file `source` and write its columns to the npz `target`; return the exit code."""
    path = Path(source)
    what, package, read = READERS[path.suffix.lower()]
    try:
        for name in {package, "h5py"} if path.suffix == ".mat" else {package}:
            import_module(name)
    except ModuleNotFoundError as lack:
        print(f"reading {what}: {missing(lack.name or package)}")
        return _REFUSED
    _limit(path.stat().st_size)
    try:
        columns, rows = read(path)
        if not columns:
            raise TableError("it holds no columns of numbers or text")
        numbered = {str(number): column for number, column in enumerate(columns.values())}
        np.savez(target, names=np.array(list(columns)), rows=np.array(rows, np.int64), **numbered)  # type: ignore[arg-type]
    except TableError as reason:
        print(reason)
    except MemoryError:
        print(f"it needs more than {MEMORY} bytes of memory: save it as CSV")
    except Exception as reason:
        # Whatever a library raises for bytes that it cannot read.
        why = " ".join(str(reason).split()) or type(reason).__name__
        print(f"cannot be read as {what}: {shortened(why, 300)}")
    else:
        return 0
    return _REFUSED


if __name__ == "__main__":
    # Skip Python's shutdown: a library that was interrupted half-way may crash there.
    code = main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(code)
