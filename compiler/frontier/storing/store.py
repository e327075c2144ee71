"""Answers that outlive the run that found them: a file that grows by whole lines, keyed by what was asked."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import blake2b
from pathlib import Path
from typing import Self, TypeVar
from zlib import crc32

import msgspec

from thenar.drivers.errors import ThenarError
from thenar.runtime.files import is_special, read_file, sync_folder
from thenar.runtime.recording.writer import AppendedFile

# Bytes; a frontier of the largest set answers a few million questions.
LARGEST = 1 << 30
HEADER = b'{"thenar":"store of answers","schema":1}\n'

_Answer = TypeVar("_Answer")


class StoreError(ThenarError, OSError):
    """A store cannot be opened or written to, another run has it, or the file is none."""


class _Line(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One answer. `crc` is the CRC-32 of key and answer: what a loss of power leaves behind is not taken for one."""

    key: str
    crc: int
    answer: msgspec.Raw


class Store:
    """The answers in file `path`, for one run at a time; used as a context manager, or closed.

    scope  all that every answer rests on and no key says: the set's fingerprint, the version of the methods. It is
           part of each key's digest, so that one file may hold answers of several scopes, which never meet.

    The file is a header and a line of JSON an answer. What `put` has returned from survives a kill, and a loss of power
    takes at most the last second (see AppendedFile). A line that is torn or damaged counts as never written; what
    follows the last good line is cut off on opening. Raises StoreError.
    """

    def __init__(self, path: Path, scope: str) -> None:
        self._path = path
        self._scope = scope.encode()
        self._answers: dict[str, bytes] = {}
        if is_special(path):
            raise StoreError(f"{path} is a device or a pipe: name a file")
        with _told(path):
            self._lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            with _told(path):
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._file = AppendedFile(path, self._read(read_file(path, LARGEST, StoreError)))
            if self._file.size == 0:
                self._append(HEADER)
                sync_folder(path.parent)
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        """Return the number of answers, of all scopes."""
        return len(self._answers)

    def close(self) -> None:
        """Bring everything to the disk and let other runs have the file. May be called again."""
        if self._lock >= 0:
            self._file.close()
            os.close(self._lock)
            self._lock = -1

    def get(self, key: msgspec.Struct, kind: type[_Answer]) -> _Answer | None:
        """Return the answer to `key`; None if there is none, or none that reads as `kind`: it is to be found again."""
        data = self._answers.get(self.digest(key))
        if data is None:
            return None
        try:
            return msgspec.json.decode(data, type=kind)
        except (ValueError, RecursionError):
            return None

    def put(self, key: msgspec.Struct, answer: msgspec.Struct) -> None:
        """Append the answer to `key`, which replaces an older one. Raises StoreError, for one if the disk is full."""
        digest, data = self.digest(key), msgspec.json.encode(answer)
        line = _Line(digest, _crc(digest, data), msgspec.Raw(data))
        self._append(msgspec.json.encode(line) + b"\n")
        self._answers[digest] = data

    def digest(self, key: msgspec.Struct) -> str:
        """Return what stands for `key`, a struct whose class says what kind of question it is, in this scope."""
        kind = type(key)
        asked = msgspec.json.encode(key, order="deterministic")
        parts = (self._scope, f"{kind.__module__}.{kind.__qualname__}".encode(), asked)
        return blake2b(b"\0".join(parts), digest_size=16).hexdigest()

    def _read(self, data: bytes) -> int:
        """Take the answers in `data`; return how many of its bytes are worth keeping."""
        if HEADER.startswith(data):
            return 0  # new, or killed while the header was written
        if not data.startswith(HEADER):
            raise StoreError(f"{self._path} is no store of answers, or a newer thenar's: name another file")
        kept = at = len(HEADER)
        for line in data[len(HEADER) :].splitlines(keepends=True):
            at += len(line)
            if line.endswith(b"\n") and self._take(line):
                kept = at
        return kept

    def _take(self, line: bytes) -> bool:
        try:
            read = msgspec.json.decode(line, type=_Line)
        except (ValueError, RecursionError):
            return False
        data = bytes(read.answer)
        if read.crc != _crc(read.key, data):
            return False
        self._answers[read.key] = data
        return True

    def _append(self, data: bytes) -> None:
        if not self._file.append(data):
            raise StoreError(
                f"{self._file.failure or f'{self._path} is closed'}; its {len(self)} answers are kept: free some space "
                "and do the same again"
            )


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn what the operating system says of `path` into a StoreError."""
    try:
        yield
    except StoreError:
        raise
    except BlockingIOError:
        raise StoreError(f"{path} is in use by another run: wait for its end, or name another file") from None
    except OSError as reason:
        raise StoreError(f"{path} cannot be opened: {reason.strerror}") from reason


def _crc(key: str, data: bytes) -> int:
    return crc32(data, crc32(key.encode()))
