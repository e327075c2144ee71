"""A persistent cache: functions whose results are stored, the file that stores them, and the workers that compute."""

import fcntl
import os
import platform
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from hashlib import blake2b
from inspect import signature
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import msgspec
import numpy as np

from thenar.drivers.closing import Closing
from thenar.drivers.errors import ThenarError
from thenar.runtime.files import is_special

from ..workers import in_workers

_SQLITE = b"SQLite format 3\0"
# Marks the files of stores among those of SQLite.
_APPLICATION = int.from_bytes(b"then")

Report = Callable[[int, int], None]
# Steps of the progress of one round.
ROUND = 100
F = TypeVar("F", bound=Callable[..., Any])
R = TypeVar("R")


class StoreError(ThenarError, OSError):
    """A store that cannot be opened or written to, is in use by another run, or is another kind of file."""


# The version of each stored function, and whether it runs in this very process; the machine is then part of the key.
_STORED: dict[Callable[..., Any], tuple[int, bool]] = {}


def stored(version: int, *, here: bool = False) -> Callable[[F], F]:
    """Return a decorator of functions whose results a `Cache` stores.

    Parameters
    ----------
    version : int
        Raise it when the function's results change.
    here : bool
        Whether it runs in this very process, not in workers, since it measures this machine.

    Notes
    -----
    The function must be one of a module, its result of a type that JSON carries without loss. Arguments must be
    encodable by msgspec, arrays, or objects with an encodable `identity`. A direct call computes a new result.
    """

    def register(function: F) -> F:
        _STORED[function] = version, here
        return function

    return register


def question(function: Callable[..., Any], args: Sequence[Any], digests: dict[int, str]) -> bytes:
    """Return everything that determines a stored function's result within the store's scope: its name, its version and
    the arguments.

    digests  of arrays by their ids, while these live: each is digested once
    """

    def plain(value: Any) -> object:
        if isinstance(value, np.ndarray):
            return digests.get(id(value)) or digests.setdefault(id(value), _digest(value))
        return value.identity  # of a class that supports caching; AttributeError for all others

    version, here = _STORED[function]
    bound = signature(function).bind(*args)
    bound.apply_defaults()
    machine = platform.node() if here else ""
    asked = (f"{function.__module__}.{function.__qualname__}", version, machine, bound.arguments)
    return msgspec.json.encode(asked, enc_hook=plain, order="deterministic")


class Store(Closing):
    """The results in file `path`, for one run at a time; used as a context manager, or closed.

    scope  common dependencies of all results, such as the version of thenar. It is part of each key, so that one file
           may hold results of several scopes, which never mix.

    The file is a database of SQLite. Results survive a kill once `put` has returned. Raises StoreError.
    """

    def __init__(self, path: Path, scope: str) -> None:
        self._path, self._scope = path, scope.encode()
        self._database: sqlite3.Connection | None = None
        if is_special(path):
            raise StoreError(f"{path} is a device or a pipe: name a file")
        with _opened(path):
            self._lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            with _opened(path):
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                head = os.pread(self._lock, len(_SQLITE), 0)
            # SQLite takes a file of a few bytes for an empty one.
            if head not in (b"", _SQLITE):
                raise StoreError(f"{path} is no store of results: name another file")
            self._connect()
        except BaseException:
            self.close()
            raise

    def __len__(self) -> int:
        """Return the number of results, of all scopes."""
        with self._asked() as database:
            return int(database.execute("SELECT count(*) FROM results").fetchone()[0])

    def close(self) -> None:
        """Write everything to disk and unlock the file for other runs. May be called again."""
        self.finish()
        # Not before: closing any descriptor of a file takes SQLite's own locks from it.
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def finish(self) -> None:
        """Write everything into the one file, which may be moved from then on. It stays locked for other runs."""
        if self._database is not None:
            self._database.close()
            self._database = None

    def get(self, asked: bytes, kind: type[R]) -> R | None:
        """Return the result, or None if there is none that decodes as `kind`, and it must be computed."""
        with self._asked() as database:
            found = database.execute("SELECT result FROM results WHERE key = ?", (self._key(asked),)).fetchone()
        if found is None:
            return None
        try:
            return msgspec.json.decode(found[0], type=kind)
        except (ValueError, TypeError, RecursionError):
            return None

    def put(self, asked: bytes, result: object) -> None:
        """Store the result, which replaces an older one. Raises StoreError, for example if the disk is full."""
        row = self._key(asked), msgspec.json.encode(result)
        if self._database is None:
            raise StoreError(f"{self._path} is closed")
        try:
            self._database.execute("INSERT OR REPLACE INTO results VALUES (?, ?)", row)
        except sqlite3.Error as reason:
            raise StoreError(
                f"{self._path} cannot be written: {reason}; its {len(self)} results are kept: free some space and run "
                "this again"
            ) from reason

    def _key(self, asked: bytes) -> bytes:
        return blake2b(self._scope + b"\0" + asked, digest_size=16).digest()

    def _connect(self) -> None:
        """Open the database, or make it in an empty file."""
        with self._asked(sqlite3.connect(self._path, isolation_level=None)) as database:
            new = database.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,)
            if database.execute("PRAGMA application_id").fetchone() != (0 if new else _APPLICATION,):
                raise StoreError(f"{self._path} is no store of results: name another file")
            # Of one run: without shared memory. A kill loses nothing; a loss of power, at most the last results.
            database.execute("PRAGMA locking_mode = EXCLUSIVE")
            database.execute("PRAGMA journal_mode = WAL")
            database.execute("PRAGMA synchronous = NORMAL")
            if new:
                database.execute(f"PRAGMA application_id = {_APPLICATION}")
                database.execute("CREATE TABLE results (key BLOB PRIMARY KEY, result BLOB NOT NULL) WITHOUT ROWID")

    @contextmanager
    def _asked(self, opened: sqlite3.Connection | None = None) -> Iterator[sqlite3.Connection]:
        """Yield the database, `opened` just now; turn an error of SQLite into a StoreError."""
        self._database = opened or self._database
        if self._database is None:
            raise StoreError(f"{self._path} is closed")
        try:
            yield self._database
        except sqlite3.OperationalError as reason:
            raise StoreError(f"{self._path} cannot be read: {reason}") from reason
        except sqlite3.Error as reason:
            raise StoreError(f"{self._path} is no store of results: {reason}: name another file") from reason


class Cache:
    """Returns stored results at once, computes the others in workers and stores them.

    report   called with done and total: every call of `ask` is a round of the same weight, ROUND
    rounds   how many rounds there will be
    jobs     as for in_workers. Results do not depend on it.
    """

    def __init__(self, store: Store, report: Report, rounds: int = 1, *, jobs: int = -1) -> None:
        self._store, self._report, self._rounds, self._jobs = store, report, rounds, jobs
        self._begun = 0

    def ask(self, function: Callable[..., R], calls: Sequence[tuple[Any, ...]]) -> list[R]:
        """Return the results of a stored function for each tuple of arguments; equal calls are computed once.

        Raises StoreError, exceptions of the function, and those of in_workers; results computed until then are stored.
        """
        self._begun += 1
        if not calls:
            self._tell(1, 1)
            return []
        kind: type[R] = get_type_hints(function)["return"]
        here, digests = _STORED[function][1], dict[int, str]()
        questions = [question(function, args, digests) for args in calls]
        asked = dict(zip(questions, calls, strict=True))
        found = {key: known for key in asked if (known := self._store.get(key, kind)) is not None}
        todo = [key for key in asked if key not in found]
        self._tell(len(found), len(asked))
        tasks = ((number, function, asked[key]) for number, key in enumerate(todo))
        jobs = 1 if here else self._jobs
        for number, result in in_workers(_computed, tasks, jobs):
            key = todo[number]
            self._store.put(key, result)
            # Decode it as a later run would: a new result must not differ from a stored one.
            read = self._store.get(key, kind)
            if read is None:
                raise TypeError(f"the result of {function.__name__} is no {kind} when read from JSON")
            found[key] = read
            self._tell(len(found), len(asked))
        return [found[key] for key in questions]

    def _tell(self, done: int, calls: int) -> None:
        """Report the share of this round that is done, and the rounds before it."""
        self._report((self._begun - 1) * ROUND + ROUND * done // calls, self._rounds * ROUND)


def _computed(task: tuple[int, Callable[..., R], tuple[Any, ...]]) -> tuple[int, R]:
    number, function, args = task
    return number, function(*args)


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
