"""Files that are written whole or not at all, and read within a limit."""

import errno
import os
import tempfile
from pathlib import Path

from thenar.drivers.files import open_file, read_file

__all__ = ["is_special", "open_file", "read_file", "sync_folder", "write_atomically"]


def write_atomically(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Write `data` to `path`: temporary file in the same folder, fsync, rename, fsync of the folder.

    A reader sees the old file or the new one, never a part; after a kill or a full disk the old one is still there. The
    file's mode is `mode` without the bits of the umask. Raises OSError as the operating system gives it, with `path` as
    its file; also if `path` is a device or a pipe, which a rename would replace.
    """
    if is_special(path):
        raise OSError(errno.EINVAL, "is a device or a pipe, not a file that could be replaced", str(path))
    try:
        _write_beside_and_rename(path, data, mode)
    except OSError as reason:
        # The user does not know the temporary file.
        raise OSError(reason.errno, reason.strerror, str(path)) from reason


def _write_beside_and_rename(path: Path, data: bytes, mode: int) -> None:
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        # The only portable way to read the umask is to set it.
        umask = os.umask(0)
        os.umask(umask)
        Path(temporary).chmod(mode & ~umask)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def is_special(path: Path) -> bool:
    """Return whether the path is neither a file nor a folder, such as /dev/null."""
    return path.exists() and not path.is_file() and not path.is_dir()


def sync_folder(folder: Path) -> None:
    """Make renames inside `folder` durable (POSIX: fsync of the directory)."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
