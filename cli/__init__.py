"""The command `thenar`; it imports nothing heavy until a sub-command runs.

Exit codes: 0 done, 1 a check failed (`verify`, `stability`), 2 a mistake that the user can fix, 130 Ctrl-C,
143 SIGTERM, 129 SIGHUP.
"""

import os
import signal
import socket
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from threading import Event, Thread, current_thread, main_thread
from types import FrameType

# A shell reports a command ended by a signal as this plus the signal's number.
SIGNALLED = 128
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def run(arguments: Sequence[str]) -> int:
    """Run `thenar` with `arguments` and return its exit code; report a user's mistake in one sentence on stderr."""
    came = [signal.SIGINT]
    try:
        with _ended_like_ctrl_c(came):
            # Imported here, so that Ctrl-C during the imports is handled like any other.
            from .group import run_group

            _escape_the_unencodable()
            return run_group(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("thenar: interrupted\n" if came[-1] == signal.SIGINT else "thenar: terminated\n")
        return SIGNALLED + came[-1]


@contextmanager
def _ended_like_ctrl_c(came: list[signal.Signals]) -> Iterator[None]:
    """Make SIGTERM and SIGHUP interrupt this context like Ctrl-C, and record them; a second one ends the process at
    once. So workers end and no partial file remains.
    """

    def end(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)
        came.append(signal.Signals(number))
        raise KeyboardInterrupt

    is_main = current_thread() is main_thread()
    # A signal that is ignored (nohup) stays ignored.
    heard = [n for n in (signal.SIGTERM, signal.SIGHUP) if is_main and signal.getsignal(n) is signal.SIG_DFL]
    for number in heard:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in heard:
            signal.signal(number, signal.SIG_DFL)


def _escape_the_unencodable() -> None:
    r"""Make stdout and stderr write unencodable characters as "\u2603" instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            with suppress(ValueError):  # closed
                stream.reconfigure(errors="backslashreplace")


@contextmanager
def ended_by_signals() -> Iterator[Event]:
    """Yield an event that SIGINT, SIGTERM and SIGHUP set; a second SIGINT interrupts as usual.

    A signal that the parent process ignores (`nohup`) stays ignored.
    """
    stop = Event()

    def end(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, before[signal.Signals(number)])
        # In a thread, because this handler may interrupt code that holds the lock of `stop`.
        Thread(target=stop.set, name="thenar end", daemon=True).start()

    heard = [number for number in _ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, end) for number in heard}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def notify(state: bytes) -> None:
    """Tell systemd a state of this program, if that has started it."""
    if place := os.environ.get("NOTIFY_SOCKET"):
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
            line.setblocking(False)
            line.sendto(state, f"\0{place[1:]}" if place[0] == "@" else place)


def main() -> None:
    """Run the command `thenar`: the entry point."""
    sys.exit(run(sys.argv[1:]))
