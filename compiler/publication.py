"""Publish folders as a whole: write next to the target, make durable, then exchange with the existing folder.

Writing takes place in a box, the folder `.NAME.XXXXXXXX.part` next to the published folder. It holds at most

    part  the folder that is being written
    new   the complete folder; after the exchange, the folder that was replaced
    old   the folder that was replaced, if the file system cannot exchange two names
    gone  a folder that is being deleted

Its writer holds a lock on it. A box of a killed writer is not locked, and the next publication deletes it.
"""

import ctypes
import errno
import fcntl
import filecmp
import os
import re
import secrets
import shutil
import stat
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from thenar.drivers.errors import ThenarError
from thenar.runtime.files import sync_folder

# Returns the user's entries in a folder, in the format of `entries`: they are kept. Raises if the folder may not be
# replaced. It is also called for a replaced folder, at another path and name.
Theirs = Callable[[Path], Collection[str]]

_PART, _NEW, _OLD, _GONE = "part", "new", "old", "gone"
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2
_CANNOT_EXCHANGE = frozenset({errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP})
_APPEARED = frozenset({errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR})


def entries(folder: Path) -> list[str]:
    """Return the paths below `folder` of all files and empty folders in it, in order."""
    found: list[str] = []
    for inner in sorted(folder.iterdir()):
        below = entries(inner) if inner.is_dir() and not inner.is_symlink() else []
        found += [f"{inner.name}/{path}" for path in below] or [inner.name]
    return found


def check_folder(folder: Path, theirs: Theirs, raises: type[ThenarError]) -> tuple[Path, Collection[str]]:
    """Return `folder`, resolved, and the user's entries in it; delete the boxes of killed publications.

    Raises `raises` if no folder can be exchanged there, and whatever `theirs` raises.
    """
    target = folder.resolve()
    if not target.parent.is_dir():
        raise raises(f"{target.parent} is no folder: make it first, then write {folder}")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise raises(f"{target.parent} is not writable: name a folder elsewhere")
    sweep(target, theirs)
    if not target.exists():
        return target, ()
    if not target.is_dir():
        raise raises(f"{folder} is a file: name a folder")
    if target.is_mount() or _is_current(target):
        raise raises(f"{folder} is a mount point or the current folder and cannot be replaced: name a folder in it")
    return target, theirs(target)


def _is_current(target: Path) -> bool:
    with suppress(FileNotFoundError):
        return Path.cwd().is_relative_to(target)
    return False


def publish_folder(files: Mapping[str, bytes], folder: Path, theirs: Theirs, raises: type[ThenarError]) -> Path:
    """Write `files`, path below the folder -> content, as `folder`; return it, resolved.

    The user's entries are in the new folder too, as the same files (copies if there are no hard links). At every
    instant either the old or the new folder is there, whole. If the file system cannot exchange two names, neither is
    there for a moment between two renames: the next publication brings back the old one.
    Raises as `check_folder`; `raises` if a user's file is in the way, or the folder was changed meanwhile; OSError.
    """
    target, kept = check_folder(folder, theirs, raises)
    for path in kept:
        if any(path == made or made.startswith(f"{path}/") or path.startswith(f"{made}/") for made in files):
            raise raises(f"{folder} holds {path}, which thenar has not written: move it, or name another folder")
    with _box(target, theirs) as box:
        try:
            _fill(box / _PART, files)
            _carry(kept, target, box / _PART)
            for name, _, _ in os.walk(box / _PART):
                sync_folder(Path(name))
            (box / _PART).rename(box / _NEW)
            replaced = _put(box, target)
        except OSError as reason:
            if reason.errno in _APPEARED:
                raise raises(f"another program made {folder} meanwhile: run this again") from reason
            # Report the path that the user knows, not the box.
            raise OSError(reason.errno, reason.strerror, str(folder)) from reason
        if replaced is not None and not _disposable(replaced, target, theirs):
            if replaced == box / _OLD:
                target.rename(box / _PART)
                replaced.rename(target)
            elif exchanged(replaced, target):
                (box / _NEW).rename(box / _PART)
            theirs(target)
            raise raises(f"{folder} was changed while it was replaced: run this again")
        sync_folder(target.parent)
    return target


def sweep(target: Path, theirs: Theirs) -> None:
    """Delete the boxes that killed publications of `target` left next to it; boxes in use stay."""
    name = re.compile(rf"\.{re.escape(target.name)}\.[0-9a-f]{{8}}\.part")
    for box in sorted(path for path in target.parent.iterdir() if name.fullmatch(path.name)):
        with suppress(OSError):
            lock = _locked(box)
            try:
                _settle(box, target, theirs)
            finally:
                os.close(lock)


@contextmanager
def _box(target: Path, theirs: Theirs) -> Iterator[Path]:
    box, lock = _new_box(target)
    try:
        yield box
    finally:
        try:
            _settle(box, target, theirs)
        finally:
            if lock is not None:
                os.close(lock)


def _new_box(target: Path) -> tuple[Path, int | None]:
    """Return a new box and its lock; None if folders cannot be locked, in which case no sweep can delete it either."""
    while True:
        # Not named after the process id: in a container the next process may have the same one.
        box = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
        box.mkdir()
        try:
            lock = _locked(box)
        except (BlockingIOError, FileNotFoundError):
            continue  # a concurrent sweep deletes it
        except OSError:
            return box, None
        if box.exists():
            return box, lock
        os.close(lock)


def _locked(box: Path) -> int:
    """Return a descriptor that locks the box. Raises OSError if another process has it, or it is no folder."""
    lock = os.open(box, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(lock)
        raise
    return lock


def _settle(box: Path, target: Path, theirs: Theirs) -> None:
    """Delete the box's copies of published files and those written for it, and the box itself if it is then empty."""
    with suppress(OSError):
        (box / _OLD).rename(target)  # fails if the folder exists again
    shutil.rmtree(box / _PART, ignore_errors=True)
    shutil.rmtree(box / _GONE, ignore_errors=True)
    for name in (_NEW, _OLD):
        if (box / name).exists() and _disposable(box / name, target, theirs):
            # From here on the rule may fail: half a folder may look like the user's.
            (box / name).rename(box / _GONE)
            shutil.rmtree(box / _GONE, ignore_errors=True)
    with suppress(OSError):
        box.rmdir()


def _disposable(folder: Path, target: Path, theirs: Theirs) -> bool:
    """Return whether the folder's user entries, if any, are all in `target` too."""
    try:
        kept = theirs(folder)
    except (ThenarError, OSError):
        return False
    return all(_same(folder / path, target / path) for path in kept)


def _same(one: Path, other: Path) -> bool:
    """Return whether these are links to one file, or copies of it."""
    try:
        first, second = one.lstat(), other.lstat()
    except OSError:
        return False
    if os.path.samestat(first, second):
        return True
    kind = stat.S_IFMT(first.st_mode)
    if kind != stat.S_IFMT(second.st_mode):
        return False
    if kind == stat.S_IFLNK:
        return one.readlink() == other.readlink()
    return kind == stat.S_IFDIR or (kind == stat.S_IFREG and filecmp.cmp(one, other, shallow=False))


def _fill(folder: Path, files: Mapping[str, bytes]) -> None:
    folder.mkdir()
    for path, data in files.items():
        place = folder / path
        place.parent.mkdir(parents=True, exist_ok=True)
        with place.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())


def _carry(paths: Collection[str], source: Path, folder: Path) -> None:
    for path in paths:
        here, there = source / path, folder / path
        there.parent.mkdir(parents=True, exist_ok=True)
        if here.is_dir() and not here.is_symlink():
            there.mkdir()
            continue
        try:
            os.link(here, there, follow_symlinks=False)
        except OSError:
            shutil.copy2(here, there, follow_symlinks=False)
            if not there.is_symlink():
                with there.open("rb") as file:
                    os.fsync(file.fileno())


def _put(box: Path, target: Path) -> Path | None:
    """Move the new folder to its target; return the path of the replaced one, or None."""
    new, old = box / _NEW, box / _OLD
    if not target.exists():
        new.rename(target)
        return None
    if exchanged(new, target):
        return new
    target.rename(old)
    new.rename(target)
    return old


def exchanged(one: Path, other: Path) -> bool:
    """Exchange two names atomically and return True; return False if that is not supported. Raises OSError."""
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is None:
        return False
    if renameat2(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE) == 0:
        return True
    code = ctypes.get_errno()
    if code in _CANNOT_EXCHANGE:
        return False
    raise OSError(code, os.strerror(code), str(other))
