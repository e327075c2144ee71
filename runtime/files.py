"""Files that are written whole or not at all, and read within a limit."""

import errno
import os
import stat
from typing import TYPE_CHECKING, BinaryIO

from .errors import ThenarError

if TYPE_CHECKING:
    from pathlib import Path

_PIECE = 1 << 20


def write_atomically(path: "Path", data: bytes, mode: int = 0o666) -> None:
    """Write `data` to `path`: temporary file in the same folder, fsync, rename, fsync of the folder.

    A reader sees the old file or the new one, never a part; after a kill or a full disk the old one is still there
    (after a kill next to the temporary one). The file's mode is `mode` without the bits of the umask. Raises OSError as
    the operating system gives it, with `path` as its file; also if `path` is a device or a pipe, which a rename would
    replace.
    """
    if is_special(path):
        raise OSError(errno.EINVAL, "is a device or a pipe, not a file that could be replaced", str(path))
    temporary = path.with_name(f".{path.name}.{os.urandom(4).hex()}.part")
    try:
        # The system subtracts the umask.
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
                temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        sync_folder(path.parent)
    except OSError as reason:
        # The user does not know the temporary file.
        raise OSError(reason.errno, reason.strerror, str(path)) from reason


def is_special(path: "Path") -> bool:
    """Return whether the path is neither a file nor a folder, such as /dev/null."""
    return path.exists() and not path.is_file() and not path.is_dir()


def sync_folder(folder: "Path") -> None:
    """Make renames inside `folder` durable (POSIX: fsync of the directory)."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def open_file(path: "Path", raises: type[ThenarError]) -> BinaryIO:
    """Open a regular file for reading bytes. The caller closes it.

    Raises `raises` if `path` is a device, a pipe or a socket, which may never end; OSError from the operating system,
    also for a folder.
    """
    # A pipe without a writer would block open() itself.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        mode = os.fstat(descriptor).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            raise raises(f"{path} is a device or a pipe, not a file: save its content as a file first")
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_file(path: "Path", limit: int, raises: type[ThenarError]) -> bytes:
    """Return the content of a regular file of at most `limit` bytes.

    Raises `raises` if the file is larger or not regular; OSError from the operating system.
    """
    pieces, left = [], limit + 1
    with open_file(path, raises) as file:
        # read() allocates its full argument, however short the file is.
        while piece := file.read(min(left, _PIECE)):
            pieces.append(piece)
            left -= len(piece)
    if not left:
        raise raises(f"{path} is larger than {limit} bytes, the limit for such a file")
    return b"".join(pieces)
