"""A JSON header and named arrays as one npz: the payload of sealed files that hold more than a few numbers.

The npz is an uncompressed zip of .npy members, the header among them as bytes. Uncompressed, so that the same content
gives the same bytes whatever zlib is installed, and so that no file can ask for more memory than it is long.
"""

import io
import math
import re
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from thenar.runtime.errors import SealError

_MAGIC = b"\x93NUMPY"
_LARGEST = 10_000  # bytes
# Every length ends in a comma or at the bracket: where neither follows, no other way to cut the digits is tried.
_HEAD = re.compile(
    r"\{'descr': '([^']{1,40})', 'fortran_order': (True|False), "
    r"'shape': \(((?:[0-9]{1,18}+(?:, ?|(?=\))))*+)\), ?\}\s*"
)
_PLAIN = re.compile(r"[<>|=]?[biufSU][0-9]{1,9}")


@dataclass(frozen=True, slots=True)
class Head:
    """What an array is: its type, shape and order, and how many bytes it has, of which `length` are this head's."""

    dtype: np.dtype[np.generic]
    shape: tuple[int, ...]
    fortran: bool
    length: int

    @property
    def size(self) -> int:
        """The bytes of the array itself."""
        return self.dtype.itemsize * math.prod(self.shape)

    def array(self, data: "memoryview | NDArray[np.uint8]") -> NDArray[np.generic]:
        """Return the array in its bytes, of which there must be `size`."""
        flat: NDArray[np.generic] = np.frombuffer(data, self.dtype)
        return flat.reshape(self.shape, order="F" if self.fortran else "C")


def read_head(file: BinaryIO) -> Head:
    """Read the head of an array of numbers or text. Raises ValueError with the reason where it is none."""
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

# What zipfile answers bad bytes with.
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
            # A ZipInfo made by hand is dated 1980-01-01; the default would be now.
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
            # Entries of a zip may share their bytes: read one by one they would take any multiple of the file.
            if sum(info.file_size for info in infos) > len(payload):
                raise SealError(f"{what} holds arrays that overlap")
            arrays = {info.filename.removesuffix(".npy"): _read(members, info) for info in infos}
            if len(arrays) != len(infos):
                raise SealError(f"{what} holds an array twice")
    except UNREADABLE as reason:
        raise SealError(f"{what} holds no arrays that can be read: {reason}") from reason
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
