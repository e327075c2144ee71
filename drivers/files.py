"""Reading files: regular files only, up to a size limit.

It is in `drivers` for the same reason as `errors`: every package reads files, and this one imports none.
"""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

from .errors import ThenarError

_PIECE = 1 << 20


def open_file(path: Path, raises: type[ThenarError]) -> BinaryIO:
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


def read_file(path: Path, limit: int, raises: type[ThenarError]) -> bytes:
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
