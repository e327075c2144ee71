"""A JSON header and named arrays as one npz: the payload of sealed files that hold more than a few numbers.

The npz is an uncompressed zip of .npy members, the header among them as bytes. Uncompressed, so that the same content
gives the same bytes whatever zlib is installed, and so that no file can ask for more memory than it is long.
"""

import io
import zipfile
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from thenar.runtime.errors import SealError

from .npy import read_head

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
