"""Tables of other programs: spreadsheets, Parquet, HDF5, MATLAB, npz, C3D and ROS bags, read by their libraries.

They are read in a process with limits on memory and time, and returned as npz: so a file that claims a terabyte, that
crashes a library or that never ends, ends in an error message. The process ends with the one that started it, and
leaves no files. Nothing is unpickled; links to other files are not followed.
"""

import ctypes
import os
import resource
import signal
import subprocess
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

import numpy as np
from numpy.dtypes import StringDType
from numpy.typing import NDArray

from thenar.drivers.extras import missing
from thenar.runtime.files import open_file
from thenar.runtime.names import SHOWN, list_names, shortened

from ..arrays import AnyArray
from . import COLUMNS, LARGEST, ROWS, TableError
from .bags import is_folder, read_bag
from .cells import preface

# Bytes of memory that reading may take in addition to the libraries: a constant, and a factor per byte of the file.
MEMORY, MEMORY_EACH = 600_000_000, 20
# Seconds of processor time: a constant, and the number of bytes that add a second. By the clock it may take a few times
# as long, on a busy machine.
CPU_S, CPU_BYTES = 60, 200_000
WALL = 4
# Rows of a spreadsheet among which its header is.
_SEEN_ROWS = 200
# The exit code of the child if its output says why a file is rejected.
_REFUSED = 3
_PR_SET_PDEATHSIG = 1

Columns = dict[str, AnyArray]
# A table: its columns, text or numbers, the numbers of its rows for the user, how many rows precede its header, and
# sentences on what was left out.
Foreign = tuple[Columns, NDArray[np.int64], int, tuple[str, ...]]


def read_foreign(paths: Sequence[Path], skip: int | None = 0) -> Iterator[Foreign]:
    """Yield foreign tables.

    paths  tables of one kind, read in one process
    skip   how many rows of a spreadsheet precede its header; None: find it

    Raises TableError with the reason, for the first table that was not yielded.
    """
    size = 0
    for path in paths:
        size += (length := size_of(path))
        if length > LARGEST:
            raise TableError(f"{path.name} is larger than {LARGEST} bytes, the most that is read of a table")
    with TemporaryFile() as made:
        try:
            refusal = _run(paths, skip, _cpu_s(size), made)
        except TableError:
            if len(paths) == 1:
                raise
            for path in paths:  # to know which
                yield from read_foreign([path], skip)
            return
        # Written by the process from plain columns. Each is read as it is asked for.
        made.seek(0)
        arrays: Mapping[str, AnyArray] = np.load(made) if os.fstat(made.fileno()).st_size else {}
        count = len([name for name in arrays if name.endswith(".rows")])
        for number in range(count):
            names, rows, skipped, notes = (arrays[f"{number}.{name}"] for name in ("names", "rows", "skip", "notes"))
            columns = {str(name): arrays[f"{number}.{place}"] for place, name in enumerate(names)}
            yield columns, rows.astype(np.int64), int(skipped.astype(np.int64)[0]), tuple(map(str, notes))
    if refusal:
        raise TableError(f"{paths[count].name}: {refusal}")


def size_of(path: Path) -> int:
    """Return the bytes of a file, or of those in a folder."""
    if path.is_dir():
        return sum(each.stat().st_size for each in path.iterdir() if each.is_file())
    with open_file(path, TableError) as file:
        return os.fstat(file.fileno()).st_size


def _run(paths: Sequence[Path], skip: int | None, seconds: int, made: IO[bytes]) -> str:
    """Read tables in a process, up to the first that it refuses, into `made`; return why it refuses that, or "".

    Raises TableError if the process crashes, or takes longer than `seconds` of processor time.
    """
    command = [sys.executable, "-P", "-m", __name__, str(skip), str(os.getpid()), *map(os.path.abspath, paths)]
    what = f"{paths[0].name}: its reader"
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=made,
            stderr=subprocess.PIPE,
            timeout=WALL * seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise TableError(f"{what} took longer than {WALL * seconds} s: save it as CSV") from None
    if done.returncode == -signal.SIGXCPU:
        raise TableError(f"{what} took longer than {seconds} s of processor time: save it as CSV")
    if done.returncode not in (0, _REFUSED):
        raise TableError(f"{what} gave up: the file is damaged, or larger inside than is read: save it as CSV")
    said = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
    return shortened(said, 600) if done.returncode else ""


def _spreadsheet(path: Path, skip: int | None, notes: list[str]) -> tuple[Columns, Sequence[int], int]:
    from python_calamine import load_workbook

    book = load_workbook(path)
    sheets = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in book.sheet_names}
    lengths = {name: sum(any(cell != "" for cell in row) for row in sheet) for name, sheet in sheets.items()}
    # The longest one holds the frames; a sheet of notes may precede it.
    longest = max(lengths, key=lengths.__getitem__, default="")
    if left := [name for name, length in lengths.items() if length and name != longest]:
        notes.append(
            f"sheets left out: {list_names([shortened(name) for name in left])}; {shortened(longest)} was read"
        )
    cells = sheets.get(longest, [])
    filled = [number for number, row in enumerate(cells) if any(cell != "" for cell in row)]
    if not filled:
        raise TableError("it holds no sheet with cells")
    if skip is None:
        before = preface([[_text(cell) for cell in cells[number]] for number in filled[:_SEEN_ROWS]])
        skip = filled[before] if before else 0
    filled = [number for number in filled if number >= skip]
    if not filled:
        raise TableError(f"it holds no cells below row {skip} (`skip`)")
    head = [_text(cell) for cell in cells[filled[0]]]
    body = filled[1:]
    columns: Columns = {}
    for place, name in enumerate(head):
        column = [cells[row][place] for row in body]
        if name or any(cell != "" for cell in column):
            _add(columns, name or f"column {place + 1}", _array(column))
    return columns, [row + 1 for row in body], skip


def _parquet(path: Path, _: list[str]) -> Columns:
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
    return columns


def _hdf5(path: Path, _: list[str]) -> Columns:
    import h5py

    found: Columns = {}

    def visit(name: str, item: object) -> None:
        if not isinstance(item, h5py.Dataset) or not 1 <= item.ndim <= 2:
            return
        text = h5py.check_string_dtype(item.dtype)
        if text or item.dtype.kind in "biuf":
            _check(item.shape[0], 1)
            if item.external or item.is_virtual:
                raise TableError(f"{shortened(repr(item.name))} lies in another file: copy it into this one")
            found[name] = np.array(item.asstr("utf-8", "replace")[()], np.str_) if text else item[()]

    with h5py.File(path, "r", locking=False) as file:
        file.visititems(visit)
    return _even(found)


def _matlab(path: Path, notes: list[str]) -> Columns:
    from scipy.io import loadmat, whosmat

    try:
        found = loadmat(path, squeeze_me=False, chars_as_strings=True)
    except NotImplementedError:
        raise TableError("it is of MATLAB 7.3: save it with the option -v7") from None
    named = (variable for name, value in found.items() if name[:2] != "__" for variable in _variables(name, value))
    variables: dict[str, AnyArray] = {}
    for name, value in named:
        if name in variables:
            raise TableError(f"two variables or fields are called {shortened(repr(name))}: rename one")
        variables[name] = value
    if not variables:
        seen = [f"{name} ({kind} {_shape(shape)})" for name, shape, kind in whosmat(path)]
        raise TableError(f"it holds no arrays of numbers or text: it holds {list_names(seen) or 'nothing'}")
    frames = {name for name, value in variables.items() if value.dtype == object and any(map(_is_frames, value.flat))}
    if frames:
        return _of_cells(variables, frames, notes)
    for name, value in variables.items():
        if value.dtype == object:
            variables[name] = _array([_cell(each) for each in value.flat])
    return _even(variables)


def _variables(name: str, value: Any) -> Iterator[tuple[str, AnyArray]]:
    """Yield the arrays and cell arrays in a MATLAB variable; the fields of structures, of several as cell arrays."""
    if not isinstance(value, np.ndarray) or type(value).__name__ == "MatlabOpaque":
        raise TableError(f"variable {shortened(repr(name))} is not an array: save each column of a table as an array")
    for field in value.dtype.names or ():
        yield from _variables(field, value[field] if value.size > 1 else value.ravel()[0][field])
    if value.dtype.kind in "biufU" or (value.dtype == object and any(cell is not None for cell in value.flat)):
        yield name, value


def _is_frames(cell: Any) -> bool:
    return isinstance(cell, np.ndarray) and cell.size > 1 and cell.ndim == 2 and cell.dtype.kind in "biuf"


def _cell(value: Any) -> object:
    array = np.asarray(value)
    return "" if not array.size else array.item() if array.size == 1 else str(value)


def _seen(arrays: Mapping[str, AnyArray]) -> str:
    """Return the names and shapes of arrays, and the shapes of what is in their cells."""
    shown = []
    for name, array in arrays.items():
        cells = [_shape(np.shape(cell)) for cell in array.flat] if array.dtype == object else []
        shown.append(f"{name} ({_shape(array.shape)}{': ' * bool(cells)}{list_names(cells[:SHOWN], len(cells))})")
    return f"it holds {list_names(shown) or 'nothing'}"


def _shape(shape: Sequence[int]) -> str:
    return "x".join(map(str, shape))


def _of_cells(variables: Mapping[str, AnyArray], frames: Collection[str], notes: list[str]) -> Columns:
    """Return the columns of cell arrays `frames`, whose cells hold the frames of a trial each, and of other variables
    with a value for each cell.
    """
    stacked = {name: _stacked(variables[name]) for name in variables if name in frames}
    (name, (_, lengths)), *_ = stacked.items()
    shape = variables[name].shape
    alike = (variables[name].shape == shape and sizes == lengths for name, (_, sizes) in stacked.items())
    if not all(alike) or any(len(rows) != sum(lengths) for rows, _ in stacked.values()):
        raise TableError(f"its cells are not trials with columns of equal length: {_seen(variables)}")
    columns: Columns = {"trial": np.repeat(np.arange(1, len(lengths) + 1), lengths)}
    for name, value in variables.items():
        if name in frames:
            _add(columns, name, stacked[name][0])
            continue
        try:
            values = np.broadcast_to(value.reshape(shape) if value.size == len(lengths) else value, shape)
        except ValueError:
            notes.append(f"variable left out, of another size than the cells: {name} ({_shape(value.shape)})")
            continue
        columns[name] = np.repeat(_array([_cell(cell) for cell in values.flat]), lengths)
    return columns


def _stacked(cells: AnyArray) -> tuple[AnyArray, list[int]]:
    """Return the frames (n, k) in all `cells`, one below the other, and how many are in each; no frames if the cells
    have unequal columns. Frames are rows, but columns if the cells are equally high and not equally wide.
    """
    parts = [np.asarray(cell) for cell in cells.flat]
    filled = [part for part in parts if part.size]
    if len({part.shape[-1] for part in filled}) > 1:
        filled, parts = [part.T for part in filled], [part.T for part in parts]
    alike = len({part.shape[1:] for part in filled}) == 1 and all(part.dtype.kind in "biuf" for part in filled)
    return np.concatenate(filled) if alike else np.empty(0), [len(part) if part.size else 0 for part in parts]


def _npz(path: Path, _: list[str]) -> Columns:
    found: Columns = {}
    with path.open("rb") as file, np.lib.npyio.NpzFile(file) as arrays:
        for name in arrays.files:
            array = arrays[name]
            if not isinstance(array, np.ndarray) or array.ndim not in (1, 2) or array.dtype.kind not in "biufSU":
                shown = f"array {shortened(repr(name))} is not of numbers or text, in one or two dimensions"
                raise TableError(f"{shown}: leave it out")
            if array.dtype.kind == "S":
                array = np.char.decode(array, "utf-8")
            elif array.dtype.kind == "U":
                array = array.astype(array.dtype.newbyteorder("="))
                array.astype(StringDType())  # raises TypeError for characters that do not exist
            # A single row is one, too.
            parts = {f"{name}.{place}": part for place, part in enumerate(array.T)} if array.ndim > 1 else {name: array}
            for column, part in parts.items():
                _add(found, column, part)
    return _even(found)


def _c3d(path: Path, _: list[str]) -> Columns:
    """Read a column for each coordinate of a point, and each analog channel: its last sample in a frame of the points,
    or all samples if there are no points.
    """
    import c3d

    with path.open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", "reached end of file")
        reader = c3d.Reader(file)
        frames = list(reader.read_frames())
        rate, samples = reader.point_rate, reader.analog_per_frame
        labels = {kind: reader.get(f"{kind}:LABELS") for kind in ("POINT", "ANALOG")}
    names = {kind: [label.strip() for label in found.string_array] if found else [] for kind, found in labels.items()}
    if not sum(points.size + analog.size for _, points, analog in frames):
        shown = [list_names(names[kind]) or "none" for kind in ("POINT", "ANALOG")]
        raise TableError(f"it holds no frames, of points {shown[0]} and analog channels {shown[1]}")
    points = np.stack([points for _, points, _ in frames])
    sampled = [np.atleast_2d(channels.T) for _, _, channels in frames]
    analog = np.concatenate([channels[-1:] if points.size else channels for channels in sampled])
    at = np.array([number - 1.0 for number, _, _ in frames])
    columns: Columns = {"time_s": (at if points.size else (at[:, None] + np.arange(samples) / samples).ravel()) / rate}
    for number, name in enumerate([*names["POINT"], *[""] * points.shape[1]][: points.shape[1]], start=1):
        valid = points[:, number - 1, 3] >= 0
        for axis, values in zip("xyz", points[:, number - 1].T, strict=False):
            _add(columns, f"{name or f'point {number}'}.{axis}", np.where(valid, values, np.nan))
    for number, name in enumerate([*names["ANALOG"], *[""] * analog.shape[1]][: analog.shape[1]], start=1):
        _add(columns, name or f"analog {number}", analog[:, number - 1])
    return columns


def _even(arrays: Mapping[str, AnyArray]) -> Columns:
    """Return the arrays as columns; those with one element are left out if others have more."""
    columns: Columns = {}
    for name, array in arrays.items():
        _add(columns, name, array)
    lengths = Counter(len(column) for column in columns.values())
    if len(lengths) > 1:
        del lengths[1]
    if len(lengths) > 1:
        shown = list_names(list(map(str, sorted(lengths))))
        raise TableError(f"its arrays have unequal lengths, {shown}: {_seen(arrays)}")
    return {name: column for name, column in columns.items() if len(column) in lengths}


def _array(cells: list[Any]) -> AnyArray:
    """Return cells as numbers, with NaN for empty ones, or as text."""
    if all(cell is None or cell == "" or isinstance(cell, (int, float)) for cell in cells):
        return np.array([np.nan if cell is None or cell == "" else cell for cell in cells], np.float64)
    return np.array([_text(cell) for cell in cells], np.str_)


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, float) and cell.is_integer():
        return str(int(cell))
    return str(cell).strip()


def _add(columns: Columns, name: str, array: AnyArray) -> None:
    """Add an array by its name, or its columns by its name and a number; nothing if it has more dimensions."""
    if array.ndim > 2:
        return
    parts = {name: array.reshape(-1)}
    if array.ndim == 2 and 1 not in array.shape:
        parts = {f"{name}.{number}": column for number, column in enumerate(array.T)}
    for part, column in parts.items():
        if part in columns:
            raise TableError(f"two columns are called {shortened(repr(part))}: rename one")
        columns[part] = column
        _check(len(column), len(columns))


def _check(rows: int, columns: int) -> None:
    if rows > ROWS or columns > COLUMNS:
        raise TableError(f"it has more than {ROWS} rows or {COLUMNS} columns, the most that are read of a table")


# By suffix: the kind of file, its package, and its reader, None for spreadsheets, whose table may begin anywhere.
READERS: dict[str, tuple[str, str, Callable[[Path, list[str]], Columns] | None]] = {
    **dict.fromkeys((".xlsx", ".xls", ".ods"), ("a spreadsheet", "python_calamine", None)),
    ".parquet": ("Parquet", "pyarrow.parquet", _parquet),
    **dict.fromkeys((".h5", ".hdf5"), ("HDF5", "h5py", _hdf5)),
    ".npz": ("npz", "numpy", _npz),
    ".mat": ("a MATLAB file", "scipy.io", _matlab),
    ".c3d": ("C3D", "c3d", _c3d),
    **dict.fromkeys((".bag", ".db3", ".mcap"), ("a ROS bag", "rosbags.highlevel", read_bag)),
}


def _cpu_s(size: int) -> int:
    """Return the seconds of processor time for a file of `size` bytes."""
    return CPU_S + size // CPU_BYTES


def _limit(size: int) -> None:
    """Limit the additional memory and the processor time of this process."""
    # SIGXCPU comes at the first limit; at the second, SIGKILL, which does not say why.
    resource.setrlimit(resource.RLIMIT_CPU, (_cpu_s(size), _cpu_s(size) + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # A compressed bag is unpacked into a file.
    resource.setrlimit(resource.RLIMIT_FSIZE, (MEMORY + MEMORY_EACH * size,) * 2)
    status = Path("/proc/self/statm")
    if status.exists():
        taken = int(status.read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY + MEMORY_EACH * size,) * 2)


def _end_with(parent: int) -> None:
    """Let this process end when its `parent` does, where the system can (Linux)."""
    if prctl := getattr(ctypes.CDLL(None), "prctl", None):
        prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def main(skip: str, parent: str, *sources: str) -> int:
    """Read the tables in files `sources`, of one kind, and write their columns as npz to stdout; return the exit code.

    skip    rows before the header of a spreadsheet, or "None"
    parent  the number of the process that waits for this one

    What was read before an error is written as well.
    """
    _end_with(int(parent))
    paths = [Path(source) for source in sources]
    # What a library prints is no part of the npz.
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    what, package, read = READERS[".db3" if is_folder(paths[0]) else paths[0].suffix.lower()]
    try:
        import_module(package)
    except ModuleNotFoundError as lack:
        print(f"reading {what}: {missing(lack.name or package)}")
        return _REFUSED
    _limit(sum(map(size_of, paths)))
    made: dict[str, AnyArray] = {}
    code = 0
    for number, path in enumerate(paths):
        notes: list[str] = []
        try:
            if read is None:
                columns, rows, skipped = _spreadsheet(path, None if skip == "None" else int(skip), notes)
            elif columns := read(path, notes):
                rows, skipped = range(1, len(next(iter(columns.values()))) + 1), 0
            else:
                raise TableError("it holds no columns of numbers or text")
        except Exception as reason:  # whatever a library raises for bytes that it cannot read
            said = shortened(" ".join(str(reason).split()) or type(reason).__name__, 300)
            memory = f"it needs more than {MEMORY} bytes of memory: save it as CSV"
            cannot = memory if isinstance(reason, MemoryError) else f"cannot be read as {what}: {said}"
            print(reason if isinstance(reason, TableError) else cannot)
            code = _REFUSED
            break
        described = {"names": np.array(list(columns)), "rows": np.array(rows, np.int64), "skip": np.array([skipped])}
        described["notes"] = np.array(notes, np.str_)
        numbered = {str(place): column for place, column in enumerate(columns.values())}
        made |= {f"{number}.{name}": array for name, array in (described | numbered).items()}
    np.savez(output, **made)  # type: ignore[arg-type]
    output.flush()
    return code


if __name__ == "__main__":
    # Skip Python's shutdown: a library that was interrupted half-way may crash there.
    code = main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(code)
