"""Files that are read: regular ones only, and never more of them than their reader can use.

It lives in `drivers` for the same reason as `errors`: everybody reads files, and this room imports nobody.
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

    Raises `raises` where `path` is a device, a pipe or a socket, which may never end; OSError as the operating system
    gives it, also for a folder.
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

    Raises `raises` where the file is larger or no regular file, OSError as the operating system gives it.
    """
    pieces, left = [], limit + 1
    with open_file(path, raises) as file:
        # read() sets aside all the memory that it is asked for, however short the file.
        while piece := file.read(min(left, _PIECE)):
            pieces.append(piece)
            left -= len(piece)
    if not left:
        raise raises(f"{path} is larger than {limit} bytes, the most that is read of such a file")
    return b"".join(pieces)
