"""A file that only grows, by whole records or not at all, and that never raises once it is open."""

import os
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread

SYNC_S = 1.0


class AppendedFile:
    """Appends to `path`.

    What is appended has reached the operating system when `append` returns: no kill can take it. A loss of power can
    take about the last second, for a thread of its own calls fdatasync that often; nobody waits for it. The first
    error, such as a full disk, ends it all: `failure` says so, and the file keeps its whole records.
    """

    def __init__(self, path: Path, size: int, sync_s: float = SYNC_S) -> None:
        """Go on behind the first `size` bytes of the file; what follows them is cut off. Raises OSError."""
        self.failure: str | None = None
        self.size = size
        self._path = path
        self._synced = size
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC)
        try:
            os.ftruncate(self._file, size)
        except OSError:
            os.close(self._file)
            raise
        self._closing = Event()
        self._thread = Thread(target=self._keep_synced, args=(sync_s,), name="thenar recording", daemon=True)
        self._thread.start()

    def append(self, data: bytes) -> bool:
        """Append `data` whole and return True; return False if that fails, and ever after; and when closed."""
        if self.failure is not None or self._closing.is_set():
            return False
        try:
            written = os.write(self._file, data)
            while written < len(data):
                written += os.write(self._file, data[written:])
        except OSError as reason:
            self._fail(reason)
            # Takes back the part of the record that fitted.
            with suppress(OSError):
                os.ftruncate(self._file, self.size)
            return False
        self.size += len(data)
        return True

    def close(self) -> None:
        """Bring everything to the disk and close. May wait for the disk; may be called again."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._thread.join()
        self._sync()
        os.close(self._file)

    def _keep_synced(self, every_s: float) -> None:
        while not self._closing.wait(every_s):
            self._sync()

    def _sync(self) -> None:
        size = self.size
        if size == self._synced or self.failure is not None:
            return
        try:
            os.fdatasync(self._file)
        except OSError as reason:
            self._fail(reason)
        self._synced = size

    def _fail(self, reason: OSError) -> None:
        self.failure = (
            f"{self._path}: {reason.strerror}: the recording has stopped after {self.size} bytes, all of them whole"
        )
