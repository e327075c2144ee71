"""Arrays: numbers of equal rows, a threshold between values, and sealed npz files, the payload of our own files.

A payload is an uncompressed zip of .npy members, a JSON header among them as bytes. It is uncompressed so that the same
content gives the same bytes with every version of zlib, and so that no file can claim more memory than its length.
"""

import io
import math
import re
import zipfile
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from thenar.runtime.errors import FormatError

AnyArray = NDArray[np.generic]

_HEADER = "header"
# The header of an array as numpy writes it, after the length of the header. All quantifiers are possessive, so the time
# is linear.
_HEAD = re.compile(
    rb"\{'descr': '(\|[biu]1|<[iuf][248])', 'fortran_order': False, "
    rb"'shape': \(((?:[0-9]{1,18}+(?:, ?|(?=\))))*+)\), \}\s*+"
)
# What zipfile raises for invalid bytes.
_UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    ValueError,
    EOFError,
    OSError,
    RuntimeError,
    OverflowError,
)


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

    Raises FormatError, calling the payload `what`, unless it is exactly such an npz: no compression, no objects, no
    member longer or shorter than it says.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(payload)) as members:
            infos = members.infolist()
            if packed := [info.filename for info in infos if info.compress_type != zipfile.ZIP_STORED]:
                raise FormatError(f"array {packed[0]} is compressed")
            # Entries of a zip may share bytes: read separately, they could take any multiple of the file's size.
            if sum(info.file_size for info in infos) > len(payload):
                raise FormatError(f"{what} holds arrays that overlap")
            arrays = {info.filename.removesuffix(".npy"): _array(info.filename, members.read(info)) for info in infos}
            if len(arrays) != len(infos):
                raise FormatError(f"{what} holds an array twice")
    except _UNREADABLE as reason:
        raise FormatError(f"{what} holds no readable arrays: {reason}") from reason
    header = arrays.pop(_HEADER, None)
    if header is None or header.dtype != np.uint8:
        raise FormatError(f"{what} holds no header")
    return header.tobytes(), arrays


def _array(name: str, data: bytes) -> AnyArray:
    """Return the array in a member. Nothing is allocated for it: it is a view of `data`."""
    if data[:8] != b"\x93NUMPY\1\0":
        raise FormatError(f"array {name} is of another npy format")
    start = 10 + int.from_bytes(data[8:10], "little")
    head = _HEAD.fullmatch(data[10:start])
    if head is None:
        raise FormatError(f"array {name} is not plain numbers: its head is not as it is written here")
    dtype, shape = np.dtype(head[1].decode()), tuple(map(int, re.findall(rb"[0-9]+", head[2])))
    if start + dtype.itemsize * math.prod(shape) != len(data):
        raise FormatError(f"array {name} is not plain numbers of its shape {shape}")
    flat: AnyArray = np.frombuffer(data, dtype, offset=start)
    return flat.reshape(shape)


def groups(*columns: NDArray[np.generic]) -> NDArray[np.intp]:
    """Return a number (n,) for each row from 0 in the order of first appearance, equal where all `columns` (n,) are."""
    ids = np.zeros(len(columns[0]), np.intp)
    for column in columns:
        _, part = np.unique(column, return_inverse=True)
        # Renumber densely at once: the product of all counts may overflow.
        ids = np.unique(ids * (part.max(initial=0) + 1) + part, return_inverse=True)[1]
    _, first, ids = np.unique(ids, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[ids]


def otsu(values: NDArray[np.float64]) -> float:
    """Return the threshold that splits `values` into two classes with the least variance within (Otsu 1979).

    It lies half-way between two neighbours among the finite `values`; if there is only one value, it is that.
    """
    found, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    if len(found) < 2:
        return float(found[0]) if len(found) else 0.0
    # In units of the range, from its minimum, so that squares stay finite.
    scaled = (found / 2 - found[0] / 2) / (found[-1] / 2 - found[0] / 2)
    below, total = np.cumsum(counts)[:-1], counts.sum()
    sums = np.cumsum(scaled * counts)
    between = (sums[-1] * below - sums[:-1] * total) ** 2 / (below * (total - below))
    best = int(np.argmax(between))
    return float(found[best] / 2 + found[best + 1] / 2)


# How long what was measured is of use: in seconds, and in usual intervals.
_AGE_S, _INTERVALS = 0.5, 10

Ids = NDArray[np.intp]
Times = NDArray[np.float64]


def latest(at: Times, times: Times, at_ids: Ids | None = None, ids: Ids | None = None) -> Ids:
    """Return which of `times` (n,) is the last up to each of `at` (m,), -1 if none is; of those with equal `ids`."""
    count, total = len(times), len(times) + len(at)
    both = np.zeros(total, np.intp) if ids is None or at_ids is None else np.concatenate([ids, at_ids])
    order = np.lexsort((np.arange(total) >= count, np.concatenate([times, at]), both))
    last = np.maximum.accumulate(np.where(order < count, np.arange(total), -1))
    found = np.empty(total, np.intp)
    found[order] = np.where((last >= 0) & (both[order[last]] == both[order]), order[last], -1)
    return found[count:]


def measured(at: Times, times: Times, at_ids: Ids | None = None, ids: Ids | None = None) -> Ids:
    """Return `latest`, -1 also where that is older than half a second and ten usual intervals. Times are in seconds."""
    found = latest(at, times, at_ids, ids)
    steps = np.diff(np.sort(times)) if ids is None else np.diff(times)[np.diff(ids) == 0]
    age = max(_AGE_S, _INTERVALS * float(np.median(steps))) if len(steps) else np.inf
    return np.where((found >= 0) & (at - times[found] <= age), found, -1)


def places(ids: Ids) -> Times:
    """Return the place (n,) of each row among those with equal `ids` (n,), from 0."""
    order = np.argsort(ids, kind="stable")
    first = np.flatnonzero(np.diff(ids[order], prepend=-1))
    place = np.empty(len(ids))
    place[order] = np.arange(len(ids)) - np.repeat(first, np.diff(first, append=len(ids)))
    return place
