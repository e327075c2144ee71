"""The command `thenar`: thin, and light until a sub-command is called.

Exit codes: 0 done, 1 a check that did not hold (`verify`, `stability`), 2 a mistake that the user can mend, 130 Ctrl-C,
143 SIGTERM, 129 SIGHUP.
"""

import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

# What a shell adds to the number of the signal that ended a command.
_SIGNALLED = 128


class Ended(KeyboardInterrupt):
    """A signal asks this process to end. It unwinds as a Ctrl-C does: workers end, nothing is left behind."""


def run(arguments: Sequence[str]) -> int:
    """Run `thenar` with `arguments` and return its exit code; what the user did wrong is one sentence on stderr."""
    came = [signal.SIGINT]
    try:
        with _ended_like_ctrl_c(came):
            # In here, so that a Ctrl-C while the libraries load is one like any other.
            from .group import run_group
            from .lines import escape_the_unencodable

            escape_the_unencodable()
            return run_group(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("thenar: interrupted\n" if came[-1] == signal.SIGINT else "thenar: terminated\n")
        return _SIGNALLED + came[-1]


@contextmanager
def _ended_like_ctrl_c(came: list[signal.Signals]) -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise `Ended` in here, and note them; a second one ends the process at once."""

    def end(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)
        came.append(signal.Signals(number))
        raise Ended

    is_main = threading.current_thread() is threading.main_thread()
    # What is ignored (nohup) stays so.
    heard = [n for n in (signal.SIGTERM, signal.SIGHUP) if is_main and signal.getsignal(n) is signal.SIG_DFL]
    for number in heard:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in heard:
            signal.signal(number, signal.SIG_DFL)


def main() -> None:
    """Entry point of the command `thenar`."""
    sys.exit(run(sys.argv[1:]))
