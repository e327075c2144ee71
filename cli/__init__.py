"""The command `thenar`; it imports nothing heavy until a sub-command runs.

Exit codes: 0 done, 1 a check failed (`verify`, `stability`), 2 a mistake that the user can fix, 130 Ctrl-C,
143 SIGTERM, 129 SIGHUP.
"""

import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from types import FrameType

# A shell reports a command ended by a signal as this plus the signal's number.
_SIGNALLED = 128


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
        return _SIGNALLED + came[-1]


@contextmanager
def _ended_like_ctrl_c(came: list[signal.Signals]) -> Iterator[None]:
    """Make SIGTERM and SIGHUP interrupt this context like Ctrl-C, and record them; a second one ends the process at
    once. So workers end and no partial file remains.
    """

    def end(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)
        came.append(signal.Signals(number))
        raise KeyboardInterrupt

    is_main = threading.current_thread() is threading.main_thread()
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


def main() -> None:
    """Run the command `thenar`: the entry point."""
    sys.exit(run(sys.argv[1:]))
