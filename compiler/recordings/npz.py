"""Tables in .npz files: a zip of arrays, each read within its claimed size, which is checked before it is allocated."""

import os
import zipfile
from pathlib import Path
from typing import BinaryIO

import numpy as np

from thenar.runtime.files import open_file
from thenar.runtime.names import shortened

from .arrays import UNREADABLE, AnyArray, Head, read_head
from .errors import COLUMNS, LARGEST, ROWS, TableError, unpacked

# Bytes of the directory at the end of the zip.
_LARGEST_DIRECTORY = 20_000_000
_CODE_POINTS = 0x110000
_CHUNK = 1 << 20


def read_arrays(path: Path) -> dict[str, AnyArray]:
    """Return column by name: a 1-D array is one, a 2-D array X gives X.0, X.1 and on; numbers, or text as str.

    Raises TableError with the reason, OSError as the operating system gives it.
    """
    with open_file(path, TableError) as file:
        try:
            return _columns(path.name, file)
        except UNREADABLE as reason:
            why = shortened(str(reason), 300) or "it is cut off or altered"
            raise TableError(f"{path.name} cannot be read as npz: {why}") from reason


def _columns(what: str, file: BinaryIO) -> dict[str, AnyArray]:
    size = os.fstat(file.fileno()).st_size
    if size > LARGEST:
        raise TableError(f"it is larger than {LARGEST} bytes, the most that is read of a table")
    _check_directory(file, size)
    columns: dict[str, AnyArray] = {}
    packed = stored = 0
    with zipfile.ZipFile(file) as members:
        for info in members.infolist():
            if info.compress_type == zipfile.ZIP_STORED:
                stored += info.file_size
            elif info.compress_type == zipfile.ZIP_DEFLATED:
                packed += info.file_size
            else:
                raise TableError(f"{_shown(info)} is not compressed as numpy.savez does")
            if stored > size:
                raise TableError("its arrays are larger than the file: their parts overlap")
            if packed > unpacked(size):
                raise TableError(
                    f"its arrays unpack to more than {unpacked(size)} bytes, the most for a file of its size: "
                    "write it with numpy.savez, which does not compress"
                )
            name = info.filename.removesuffix(".npy")
            found = _named(name, _array(members, info))
            if twice := columns.keys() & found.keys():
                raise TableError(f"two arrays make a column {shortened(repr(min(twice)))}")
            columns |= found
            if len(columns) > COLUMNS:
                raise TableError(f"it has more than {COLUMNS} columns, the most that are read of a table")
    return columns


def _check_directory(file: BinaryIO, size: int) -> None:
    """Raise TableError where the zip's directory is so long that its entries alone would take too much memory."""
    file.seek(max(size - 65_557, 0))
    end = file.read()
    place = end.rfind(b"PK\5\6")
    length = int.from_bytes(end[place + 12 : place + 16], "little") if place >= 0 else 0
    if length > _LARGEST_DIRECTORY:
        raise TableError("its directory of arrays is too long: put the columns into one array of two dimensions")
    file.seek(0)


def _array(members: zipfile.ZipFile, info: zipfile.ZipInfo) -> AnyArray:
    with members.open(info) as file:
        try:
            head = read_head(file)  # type: ignore[arg-type]
            _check_shape(head)
            if head.length + head.size != info.file_size:
                raise TableError(f"it is of other length than its shape {head.shape} takes")
        except ValueError as reason:
            raise TableError(f"array {_shown(info)}: {reason}") from reason
        # Claimed, not yet taken: pages of it become memory as they are filled.
        data = np.empty(head.size, np.uint8)
        got = 0
        while got < head.size:
            piece = file.read(min(_CHUNK, head.size - got))
            if not piece:
                raise TableError(f"array {_shown(info)} is cut off")
            data[got : got + len(piece)] = np.frombuffer(piece, np.uint8)
            got += len(piece)
        if file.read(1):
            raise TableError(f"array {_shown(info)} is longer than it says")
    return _text(_shown(info), head.array(data))


def _check_shape(head: Head) -> None:
    if len(head.shape) not in (1, 2):
        raise TableError(f"it has {len(head.shape)} dimensions: a column has one, several have two")
    if head.shape[0] > ROWS:
        raise TableError(f"it has more than {ROWS} rows, the most that are read of a table")
    if head.shape[1:] > (COLUMNS,):
        raise TableError(f"it has more than {COLUMNS} columns, the most that are read of a table")


def _named(name: str, array: AnyArray) -> dict[str, AnyArray]:
    return {name: array} if array.ndim == 1 else {f"{name}.{i}": array[:, i] for i in range(array.shape[1])}


def _text(what: str, array: AnyArray) -> AnyArray:
    """Return numbers as they are, and text as str."""
    if array.dtype.kind == "S":
        return _decoded(what, array)
    if array.dtype.kind == "U" and array.size:
        points = array.ravel(order="K").view(np.dtype(np.uint32).newbyteorder(array.dtype.byteorder))
        if points.max() >= _CODE_POINTS:
            raise TableError(f"array {what} holds characters that there are not")
    return array


def _decoded(what: str, array: AnyArray) -> AnyArray:
    """Return text of bytes as str."""
    text = np.empty(array.shape, f"U{array.dtype.itemsize}")
    step = max(_CHUNK // max(array[:1].nbytes, 64 * array[:1].size, 1), 1)
    for start in range(0, len(array), step):
        rows = array[start : start + step]
        try:
            cells = [cell.decode() for cell in rows.ravel().tolist()]
        except UnicodeDecodeError as reason:
            raise TableError(f"array {what} is not UTF-8 text: {reason.reason}") from reason
        text[start : start + step] = np.array(cells, text.dtype).reshape(rows.shape)
    return text


def _shown(info: zipfile.ZipInfo) -> str:
    return shortened(info.filename)
