"""What the commands say about sinks, on stderr."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from .lines import echo

if TYPE_CHECKING:
    from thenar.runtime.sinks import SinkReport


def nobody_listens(reports: Sequence["SinkReport"]) -> bool:
    """Return whether every reader has gone for good (`| head`)."""
    return bool(reports) and all(report.gone for report in reports)


def say_what_was_lost(reports: Sequence["SinkReport"]) -> None:
    """Print on stderr what was not sent."""
    for report in reports:
        if report.lost or report.error:
            why = f": {report.error}" if report.error else ""
            dropped = f", {report.dropped} readers dropped" if report.dropped else ""
            say(f"{report.where}: {report.sent} frames sent, {report.lost} lost{dropped}{why}")


def spoilt(reports: Sequence["SinkReport"]) -> bool:
    """Return whether a sink failed, other than by a reader's leaving."""
    return any(report.error and not report.gone and report.readers is None for report in reports)


def say(line: str) -> None:
    """Print a line on stderr, if that is still open: the terminal may have been closed."""
    with suppress(OSError):
        echo(line, err=True)
