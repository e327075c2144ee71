"""The head of a .npy array, read before anything is allocated for what it claims."""

import math
import re
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

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
