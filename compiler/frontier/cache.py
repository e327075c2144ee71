"""A persistent cache: functions whose results are stored, the file that stores them, and the workers that compute."""

import fcntl
import os
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import update_wrapper
from hashlib import blake2b
from inspect import signature
from pathlib import Path
from typing import Any, Generic, Literal, ParamSpec, TypeVar, get_type_hints
from zlib import crc32

import msgspec
import numpy as np

from thenar.drivers.closing import Closing
from thenar.drivers.errors import ThenarError
from thenar.runtime.files import is_special, read_file, sync_folder
from thenar.runtime.recording.writer import AppendedFile

from ..workers import in_workers

# Bytes; a frontier of the largest set makes a few million calls.
LARGEST = 1 << 30
HEADER = b'{"thenar":"store of results","schema":4}\n'
# Older forms of calls and results, which cannot be looked up any more.
OLD_HEADERS = tuple(b'{"thenar":"store of answers","schema":%d}\n' % n for n in (1, 2, 3))  # codespell:ignore answers

# Where a function runs: on the cluster, if there is one; in workers on this machine, whose tools it uses; in this very
# process, because it measures this machine, whose name is then part of the cache key.
Place = Literal["cluster", "machine", "process"]
Report = Callable[[int, int], None]
# Steps of the progress of one round.
ROUND = 100
P = ParamSpec("P")
R = TypeVar("R")


class StoreError(ThenarError, OSError):
    """A store that cannot be opened or written to, is in use by another run, or is another kind of file."""


class Stored(Generic[P, R]):
    """A function of a module whose results a `Cache` stores; see `stored`. A direct call computes a new result."""

    def __init__(self, function: Callable[P, R], version: int, where: Place, without: Sequence[str]) -> None:
        update_wrapper(self, function)
        self.function, self.version, self.where, self.without = function, version, where, without

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Compute and return the result."""
        return self.function(*args, **kwargs)

    def __reduce__(self) -> str:
        # Workers find it by name, like any function.
        return self.function.__qualname__

    def call(self, *args: P.args, **kwargs: P.kwargs) -> "Call[R]":
        """Return a call for `Cache.ask`."""
        return Call(self, args, kwargs)


@dataclass(frozen=True, slots=True, eq=False)
class Call(Generic[R]):
    """A stored function and its arguments."""

    work: Stored[..., R]
    args: tuple[Any, ...]
    kwargs: Mapping[str, Any]

    def __call__(self) -> R:
        """Compute and return the result."""
        return self.work(*self.args, **self.kwargs)

    def question(self, digests: dict[int, str]) -> bytes:
        """Return everything that determines the result within the store's scope: function name, version and arguments.

        digests  of arrays by their ids, while these live: each is digested once
        """

        def plain(value: Any) -> object:
            if isinstance(value, np.ndarray):
                return digests.get(id(value)) or digests.setdefault(id(value), _digest(value))
            return value.identity  # of a class that supports caching; AttributeError for all others

        bound = signature(self.work.function).bind(*self.args, **self.kwargs)
        bound.apply_defaults()
        arguments = {name: value for name, value in bound.arguments.items() if name not in self.work.without}
        machine = platform.node() if self.work.where == "process" else ""
        name = f"{self.work.function.__module__}.{self.work.function.__qualname__}"
        asked = (name, self.work.version, machine, arguments)
        return msgspec.json.encode(asked, enc_hook=plain, order="deterministic")


def stored(
    version: int, *, where: Place = "cluster", without: Sequence[str] = ()
) -> Callable[[Callable[P, R]], Stored[P, R]]:
    """Return a decorator of functions whose results a `Cache` stores.

    Parameters
    ----------
    version : int
        Raise it when the function's results change.
    where : {"cluster", "machine", "process"}
        The farthest place where it may run.
    without : sequence of str
        Names of arguments that do not affect the result.

    Notes
    -----
    The function must be one of a module, its result of a type that JSON carries without loss. Arguments must be
    encodable by msgspec, arrays, or objects with an encodable `identity`.
    """
    return lambda function: Stored(function, version, where, without)


class _Line(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One result. `crc` is the CRC-32 of key and result: it detects lines damaged by a loss of power."""

    key: str
    crc: int
    result: msgspec.Raw


class Store(Closing):
    """The results in file `path`, for one run at a time; used as a context manager, or closed.

    scope  common dependencies of all results, such as the version of thenar. It is part of each key, so that one file
           may hold results of several scopes, which never mix.

    The file is a header and one line of JSON per result. Results survive a kill once `put` has returned; a loss of
    power costs at most the last second (see AppendedFile). A torn or damaged line is ignored; everything after the last
    good line is cut off on opening. A store of an older form is emptied, and is `renewed`. Raises StoreError.
    """

    def __init__(self, path: Path, scope: str) -> None:
        self.renewed = False
        self._path = path
        self._scope = scope.encode()
        self._results: dict[str, bytes] = {}
        if is_special(path):
            raise StoreError(f"{path} is a device or a pipe: name a file")
        with _opened(path):
            self._lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            with _opened(path):
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._file = AppendedFile(path, self._read(read_file(path, LARGEST, StoreError)))
            if self._file.size == 0:
                self._append(HEADER)
                sync_folder(path.parent)
        except BaseException:
            os.close(self._lock)
            raise

    def __len__(self) -> int:
        """Return the number of results, of all scopes."""
        return len(self._results)

    def close(self) -> None:
        """Write everything to disk and unlock the file for other runs. May be called again."""
        if self._lock >= 0:
            self._file.close()
            os.close(self._lock)
            self._lock = -1

    def get(self, question: bytes, kind: type[R]) -> R | None:
        """Return the result, or None if there is none that decodes as `kind`, and it must be computed."""
        data = self._results.get(self._key(question))
        if data is None:
            return None
        try:
            return msgspec.json.decode(data, type=kind)
        except (ValueError, RecursionError):
            return None

    def put(self, question: bytes, result: object) -> None:
        """Append the result, which replaces an older one. Raises StoreError, for example if the disk is full."""
        key, data = self._key(question), msgspec.json.encode(result)
        line = _Line(key, _crc(key, data), msgspec.Raw(data))
        self._append(msgspec.json.encode(line) + b"\n")
        self._results[key] = data

    def _key(self, question: bytes) -> str:
        return blake2b(self._scope + b"\0" + question, digest_size=16).hexdigest()

    def _read(self, data: bytes) -> int:
        """Read the results in `data`; return how many of its bytes are valid."""
        if HEADER.startswith(data):
            return 0  # new, or killed while the header was written
        self.renewed = data.startswith(OLD_HEADERS)
        if self.renewed:
            return 0
        if not data.startswith(HEADER):
            raise StoreError(f"{self._path} is no store of results, or a newer thenar's: name another file")
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
        data = bytes(read.result)
        if read.crc != _crc(read.key, data):
            return False
        self._results[read.key] = data
        return True

    def _append(self, data: bytes) -> None:
        if not self._file.append(data):
            raise StoreError(
                f"{self._file.failure or f'{self._path} is closed'}; its {len(self)} results are kept: free some space "
                "and run this again"
            )


class Cache:
    """Returns stored results at once, computes the others in workers and stores them.

    report   called with done and total: every call of `ask` is a round of the same weight, ROUND
    rounds   how many rounds there will be
    jobs, cluster  as for in_workers. Results do not depend on either.
    """

    def __init__(
        self, store: Store, report: Report, rounds: int = 1, *, jobs: int = -1, cluster: str | None = None
    ) -> None:
        self._store, self._report, self._rounds, self._jobs, self._cluster = store, report, rounds, jobs, cluster
        self._begun = 0

    def ask(self, calls: Sequence[Call[R]]) -> list[R]:
        """Return the results in the order of `calls`, all of one function; equal calls are computed once.

        Raises StoreError, exceptions of the function, and those of in_workers; results computed until then are stored.
        """
        self._begun += 1
        if not calls:
            self._tell(1, 1)
            return []
        kind: type[R] = get_type_hints(calls[0].work.function)["return"]
        digests: dict[int, str] = {}
        questions = [call.question(digests) for call in calls]
        asked = dict(zip(questions, calls, strict=True))
        found = {key: known for key in asked if (known := self._store.get(key, kind)) is not None}
        todo = [key for key in asked if key not in found]
        self._tell(len(found), len(asked))
        for number, result in self._found([asked[key] for key in todo], calls[0].work.where):
            key = todo[number]
            self._store.put(key, result)
            # Decode it as a later run would: a new result must not differ from a stored one.
            read = self._store.get(key, kind)
            if read is None:
                raise TypeError(f"the result of {asked[key].work.function.__name__} is no {kind} when read from JSON")
            found[key] = read
            self._tell(len(found), len(asked))
        return [found[key] for key in questions]

    def _found(self, calls: Sequence[Call[R]], where: Place) -> Iterator[tuple[int, R]]:
        jobs, cluster = (1 if where == "process" else self._jobs), (self._cluster if where == "cluster" else None)
        return in_workers(_computed, enumerate(calls), jobs, cluster)

    def _tell(self, done: int, calls: int) -> None:
        """Report the share of this round that is done, and the rounds before it."""
        self._report((self._begun - 1) * ROUND + ROUND * done // calls, self._rounds * ROUND)


def _computed(numbered: tuple[int, Call[R]]) -> tuple[int, R]:
    number, call = numbered
    return number, call()


@contextmanager
def _opened(path: Path) -> Iterator[None]:
    """Turn an OSError about `path` into a StoreError."""
    try:
        yield
    except StoreError:
        raise
    except BlockingIOError:
        raise StoreError(f"{path} is in use by another run: wait for its end, or name another file") from None
    except OSError as reason:
        raise StoreError(f"{path} cannot be opened: {reason.strerror}") from reason


def _digest(array: np.ndarray[Any, Any]) -> str:
    shaped = f"{array.shape} {array.dtype.newbyteorder('<').str}\0".encode()
    data = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    return blake2b(shaped + data.tobytes(), digest_size=16).hexdigest()


def _crc(key: str, data: bytes) -> int:
    return crc32(data, crc32(key.encode()))
