"""A command and every process that it starts: ended together."""

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

_PROCESSES = Path("/proc")
_SET_CHILD_SUBREAPER = 36
_LOOK_S = 0.02


class Family:
    """A command that runs with `environment`, in our process group: it has the terminal and may ask for keys.

    On Linux this process adopts what the command leaves behind, and so finds it; elsewhere it knows the command alone.
    Raises OSError if the command cannot be run.
    """

    def __init__(self, arguments: Sequence[str], environment: Mapping[str, str]) -> None:
        _adopt_orphans()
        self._others = _children().get(os.getpid(), set())
        self.command = subprocess.Popen(arguments, env=environment)

    def end(self, patience_s: float, grace_s: float) -> None:
        """End all of it; whatever happens here, none outlives this.

        patience_s  the command is given to end by itself
        grace_s     it is given after a SIGINT, and as much what it leaves behind, after a SIGTERM
        """
        try:
            with suppress(subprocess.TimeoutExpired):
                self.command.wait(patience_s)
            if self.command.poll() is None:
                self._signal(signal.SIGINT)
                with suppress(subprocess.TimeoutExpired):
                    self.command.wait(grace_s)
            if self._signal(signal.SIGTERM):
                self._wait(grace_s)
        finally:
            while self._signal(signal.SIGKILL):
                self._wait(_LOOK_S)
            self.command.wait()

    def _wait(self, limit_s: float) -> None:
        end = time.monotonic() + limit_s
        while self._alive() and time.monotonic() < end:
            time.sleep(_LOOK_S)

    def _signal(self, number: signal.Signals) -> bool:
        """Send the signal to all that run; return whether there are any."""
        alive = self._alive()
        for process in alive:
            with suppress(ProcessLookupError, PermissionError):
                os.kill(process, number)
        return bool(alive)

    def _alive(self) -> set[int]:
        alive = set() if self.command.poll() is not None else {self.command.pid}
        children = _children()
        unseen = children.get(os.getpid(), set()) - self._others
        for orphan in unseen - {self.command.pid}:
            with suppress(ChildProcessError):
                os.waitpid(orphan, os.WNOHANG)
        while unseen:
            process = unseen.pop()
            if _runs(process):
                alive.add(process)
            unseen |= children.get(process, set())
        return alive


def _adopt_orphans() -> None:
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _children() -> dict[int, set[int]]:
    """Return the children of each process, where there is a /proc."""
    found: dict[int, set[int]] = {}
    for folder in _PROCESSES.glob("[0-9]*"):
        if fields := _fields(int(folder.name)):
            found.setdefault(int(fields[1]), set()).add(int(folder.name))
    return found


def _runs(process: int) -> bool:
    fields = _fields(process)
    return bool(fields) and fields[0] != "Z"


def _fields(process: int) -> list[str]:
    """Return state, parent and so on; nothing of a process that is gone."""
    try:
        return (_PROCESSES / str(process) / "stat").read_text(errors="replace").rpartition(")")[2].split()
    except OSError:
        return []
