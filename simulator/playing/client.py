"""A command that runs next to an emulated glove, and ends with it, with all that it started."""

import ctypes
import os
import signal
import subprocess
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

# The command receives Ctrl-C too: it gets this long to end before it is asked to.
_BY_ITSELF_S = 1.0
# Time for it after a SIGINT, and for its children after a SIGTERM.
_GRACE_S = 5.0
_SET_CHILD_SUBREAPER = 36
_LOOK_S = 0.02


@contextmanager
def running(
    arguments: Sequence[str], environment: Mapping[str, str], stop: Event
) -> Iterator["subprocess.Popen[bytes]"]:
    """Run a command within this context only; `stop` is set when it ends. None of its children outlives the context.

    The command is in our process group: it shares the terminal and may read keys. On Linux this process adopts the
    command's orphans and so finds them; elsewhere it knows only the command itself. Raises OSError if the command
    cannot be run.
    """
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    others = _children()[os.getpid()]
    command = subprocess.Popen(arguments, env=environment)

    def watch() -> None:
        command.wait()
        stop.set()

    def alive() -> set[int]:
        found = set() if command.poll() is not None else {command.pid}
        children = _children()
        unseen = children[os.getpid()] - others
        while unseen:
            found |= unseen
            unseen = {child for process in unseen for child in children[process]}
        return found

    def send(number: signal.Signals, limit_s: float) -> bool:
        """Send a signal to all running processes, and wait until they have ended; return whether there were any."""
        processes = alive()
        for process in processes:
            with suppress(ProcessLookupError, PermissionError):
                os.kill(process, number)
        end = time.monotonic() + limit_s
        while alive() and time.monotonic() < end:
            time.sleep(_LOOK_S)
        return bool(processes)

    Thread(target=watch, name="thenar client", daemon=True).start()
    try:
        yield command
    finally:
        try:
            with suppress(subprocess.TimeoutExpired):
                command.wait(_BY_ITSELF_S if stop.is_set() else 0.0)
            if command.poll() is None:
                send(signal.SIGINT, 0.0)
                with suppress(subprocess.TimeoutExpired):
                    command.wait(_GRACE_S)
            send(signal.SIGTERM, _GRACE_S)
        finally:
            while send(signal.SIGKILL, _LOOK_S):
                pass
            command.wait()


def _children() -> defaultdict[int, set[int]]:
    """Return the running children of each process, where /proc exists."""
    found = defaultdict[int, set[int]](set)
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, parent, *_ = status.read_text(errors="replace").rpartition(")")[2].split()
            if state != "Z":
                found[int(parent)].add(int(status.parent.name))
    return found
