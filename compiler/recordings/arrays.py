"""Arrays in npz files: sealed ones with a JSON header, as the payload of our own files, and users' tables.

No array is allocated before its claimed size is checked. Our own npz is an uncompressed zip of .npy members, the header
among them as bytes. It is uncompressed so that the same content gives the same bytes with every version of zlib, and so
that no file can claim more memory than its length.
"""

import io
import math
import os
import re
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from thenar.runtime.errors import SealError
from thenar.runtime.files import open_file
from thenar.runtime.names import shortened

from .errors import COLUMNS, LARGEST, ROWS, TableError, unpacked

_MAGIC = b"\x93NUMPY"
_LARGEST = 10_000  # bytes
# Every length ends in a comma or at the bracket: otherwise no other way to split the digits is tried.
_HEAD = re.compile(
    r"\{'descr': '([^']{1,40})', 'fortran_order': (True|False), "
    r"'shape': \(((?:[0-9]{1,18}+(?:, ?|(?=\))))*+)\), ?\}\s*"
)
_PLAIN = re.compile(r"[<>|=]?[biufSU][0-9]{1,9}")


@dataclass(frozen=True, slots=True)
class Head:
    """The header of an array: its type, shape and order, and its size in bytes, of which `length` are the header's."""

    dtype: np.dtype[np.generic]
    shape: tuple[int, ...]
    fortran: bool
    length: int

    @property
    def size(self) -> int:
        """The bytes of the array itself."""
        return self.dtype.itemsize * math.prod(self.shape)

    def array(self, data: "memoryview | NDArray[np.uint8]") -> NDArray[np.generic]:
        """Return the array stored in `data`, which must have `size` bytes."""
        flat: NDArray[np.generic] = np.frombuffer(data, self.dtype)
        return flat.reshape(self.shape, order="F" if self.fortran else "C")


def read_head(file: BinaryIO) -> Head:
    """Read the header of an array of numbers or text. Raises ValueError with the reason if there is none."""
    opening = file.read(8)
    if opening[:6] != _MAGIC or opening[6:] not in (b"\1\0", b"\2\0", b"\3\0"):
        raise ValueError("it does not begin as a .npy file does")
    width = 2 if opening[6] == 1 else 4
    length = int.from_bytes(file.read(width), "little")
    text = file.read(min(length, _LARGEST + 1))
    if not len(text) == length <= _LARGEST:
        raise ValueError("its head is cut off or too long")
    found = _HEAD.fullmatch(text.decode("latin-1"))
    if found is None:
        raise ValueError("its head is not what numpy writes for an array of numbers or text")
    if not _PLAIN.fullmatch(found[1]):
        raise ValueError(f"it holds {found[1]!r}, neither numbers nor text")
    try:
        dtype = np.dtype(found[1])
    except TypeError:
        raise ValueError(f"it holds {found[1]!r}, which numpy does not know") from None
    if not dtype.itemsize:
        raise ValueError("its elements have no bytes")
    return Head(dtype, tuple(map(int, re.findall("[0-9]+", found[3]))), found[2] == "True", 8 + width + length)


AnyArray = NDArray[np.generic]

# What zipfile raises for invalid bytes.
UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    ValueError,
    EOFError,
    OSError,
    RuntimeError,
    OverflowError,
)

_HEADER = "header"


def pack(header: bytes, arrays: Mapping[str, AnyArray]) -> bytes:
    """Return `header` and `arrays` (any shape; bool, integer or float) as an npz; always the same bytes."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as members:
        for name, array in {_HEADER: np.frombuffer(header, np.uint8), **arrays}.items():
            content = io.BytesIO()
            npy.write_array(content, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)
            # A ZipInfo created by hand is dated 1980-01-01; the default would be now.
            members.writestr(zipfile.ZipInfo(f"{name}.npy"), content.getvalue())
    return file.getvalue()


def unpack(payload: bytes, what: str = "payload") -> tuple[bytes, dict[str, AnyArray]]:
    """Return (header, arrays) of `pack`; the arrays are read-only views of what was read.

    Raises SealError, calling the payload `what`, unless it is exactly such an npz: no compression, no objects, no
    member longer or shorter than it says.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(payload)) as members:
            infos = members.infolist()
            if packed := [info.filename for info in infos if info.compress_type != zipfile.ZIP_STORED]:
                raise SealError(f"array {packed[0]} is compressed")
            # Entries of a zip may share bytes: read separately, they could take any multiple of the file's size.
            if sum(info.file_size for info in infos) > len(payload):
                raise SealError(f"{what} holds arrays that overlap")
            arrays = {info.filename.removesuffix(".npy"): _read(members, info) for info in infos}
            if len(arrays) != len(infos):
                raise SealError(f"{what} holds an array twice")
    except UNREADABLE as reason:
        raise SealError(f"{what} holds no readable arrays: {reason}") from reason
    header = arrays.pop(_HEADER, None)
    if header is None or header.dtype != np.uint8:
        raise SealError(f"{what} holds no header")
    return header.tobytes(), arrays


def _read(members: zipfile.ZipFile, info: zipfile.ZipInfo) -> AnyArray:
    """Return one member. Its size is checked before anything is allocated for it."""
    data = members.read(info)
    if data[6:8] != b"\1\0":
        raise SealError(f"array {info.filename} is of another npy format")
    head = read_head(io.BytesIO(data))
    if head.fortran or head.dtype.kind not in "biuf" or head.length + head.size != len(data):
        raise SealError(f"array {info.filename} is not plain numbers of its shape {head.shape}")
    return head.array(memoryview(data)[head.length :])


# Bytes of the directory at the end of the zip.
_LARGEST_DIRECTORY = 20_000_000
_CODE_POINTS = 0x110000
_CHUNK = 1 << 20


def read_arrays(path: Path) -> dict[str, AnyArray]:
    """Return column by name: a 1-D array is one column, a 2-D array X gives X.0, X.1 ...; numbers, or text as str.

    Raises TableError with the reason, and OSError from the operating system.
    """
    with open_file(path, TableError) as file:
        return arrays_in(path.name, file)


def arrays_in(what: str, file: BinaryIO, most: int = COLUMNS) -> dict[str, AnyArray]:
    """Return the columns, at most `most`, of the npz in `file`, which messages call `what`, as `read_arrays` does."""
    try:
        return _columns(file, most)
    except UNREADABLE as reason:
        why = shortened(str(reason), 300) or "it is cut off or altered"
        raise TableError(f"{what} cannot be read as npz: {why}") from reason


def _columns(file: BinaryIO, most: int) -> dict[str, AnyArray]:
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
            if len(columns) > most:
                raise TableError(f"it has more than {most} columns, the most that are read of a table")
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
                raise TableError(f"its length does not match its shape {head.shape}")
        except ValueError as reason:
            raise TableError(f"array {_shown(info)}: {reason}") from reason
        # Only reserved: its pages take memory as they are filled.
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
            raise TableError(f"array {what} holds invalid characters")
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
