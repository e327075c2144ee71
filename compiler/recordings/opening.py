"""Tables of text as lines: regular files only, gzipped or not, no more of them than the limits allow."""

import gzip
import io
import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from thenar.runtime.files import open_file

from .errors import TableError
from .limits import LARGEST, LONGEST_LINE, unpacked


@contextmanager
def open_lines(path: Path) -> Iterator[Iterator[str]]:
    """Open a text file, gzipped or not, behind its byte order mark; a fault of its content becomes a TableError."""
    zipped = path.suffix.lower() == ".gz"
    try:
        with open_file(path, TableError) as raw:
            size = os.fstat(raw.fileno()).st_size
            if size > LARGEST:
                raise TableError(f"{path.name} is larger than {LARGEST} bytes, the most that is read of a table")
            file = io.BufferedReader(_Unpacked(path.name, raw, unpacked(size))) if zipped else raw
            with io.TextIOWrapper(file, "utf-8-sig", newline="") as text:
                yield _lines(path.name, text)
    except (gzip.BadGzipFile, EOFError, zlib.error) as reason:
        raise TableError(f"{path.name} is damaged: {reason}") from reason
    except UnicodeDecodeError as reason:
        raise TableError(f"{path.name} is not UTF-8 text: {reason.reason}; save it as UTF-8") from reason


class _Unpacked(io.RawIOBase):
    """What a packed file unpacks to, as long as it is no more than `limit` bytes."""

    def __init__(self, what: str, packed: BinaryIO, limit: int) -> None:
        super().__init__()
        self._what = what
        self._file = gzip.GzipFile(fileobj=packed)
        self._limit = limit
        self._left = limit

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: "memoryview[int]") -> int:  # type: ignore[override]
        data = self._file.read(len(buffer))
        self._left -= len(data)
        if self._left < 0:
            raise TableError(
                f"{self._what} unpacks to more than {self._limit} bytes, the most for a file of its size: "
                "unpack it, then it is read as it is"
            )
        buffer[: len(data)] = data
        return len(data)


def _lines(what: str, text: io.TextIOWrapper) -> Iterator[str]:
    number = 0
    while line := text.readline(LONGEST_LINE):
        number += 1
        if len(line) == LONGEST_LINE and line[-1] not in "\r\n":
            raise TableError(f"{what} line {number} is longer than {LONGEST_LINE} characters")
        yield line
