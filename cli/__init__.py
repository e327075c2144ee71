"""The command `thenar`: thin, and light until a sub-command is called.

Exit codes: 0 done, 1 a check that did not hold (`verify`, `stability`), 2 a mistake that the user can mend, 130 Ctrl-C.
"""

import sys
from collections.abc import Sequence

INTERRUPTED = 130


def run(arguments: Sequence[str]) -> int:
    """Run `thenar` with `arguments` and return its exit code; what the user did wrong is one sentence on stderr."""
    try:
        # In here, so that a Ctrl-C while the libraries load is one like any other.
        from .group import run_group
        from .lines import escape_the_unencodable

        escape_the_unencodable()
        return run_group(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("thenar: interrupted\n")
        return INTERRUPTED


def main() -> None:
    """Entry point of the command `thenar`."""
    sys.exit(run(sys.argv[1:]))
