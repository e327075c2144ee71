"""Names of columns, grasp types, subjects and objects: those that survive every file format; and rows in messages."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import LONGEST_NAME, SHOWN, fault, list_names, nearest, shortened

from .errors import RecordingError
from .limits import NAMES, NAMES_EACH

__all__ = [
    "SHOWN",
    "check_names",
    "check_room",
    "check_simulated",
    "fault",
    "list_names",
    "list_rows",
    "nearest",
    "shortened",
]


def check_names(what: str, names: Iterable[str]) -> None:
    """Raise RecordingError unless `names` are distinct, and good by the one rule for names, `fault`."""
    seen: set[str] = set()
    for name in names:
        if reason := fault(name):
            raise RecordingError(f"{what} {shortened(repr(name))} {reason}")
        if name in seen:
            raise RecordingError(f"{what} {shortened(repr(name))} occurs twice")
        seen.add(name)


def check_simulated(text: str) -> None:
    """Raise RecordingError unless `text`, which says what simulated a set and contains its name, is good or empty."""
    if text and (reason := fault(text, 2 * LONGEST_NAME)):
        raise RecordingError(f"simulated {shortened(repr(text))} {reason}")


def check_room(rows: int, longest: int, size: int) -> None:
    """Raise RecordingError where names of `longest` characters at most, one a row, need too much memory.

    An array of text gives every row the room of the longest. `size` is how many bytes their file has.
    """
    if 4 * rows * longest > NAMES + NAMES_EACH * size:
        raise RecordingError(f"a name of {longest} characters is too long in a table of {rows} rows: shorten it")


def list_rows(rows: NDArray[np.int64]) -> str:
    """Return "row 3" or "rows 3, 4, 5, 6, 7 and 7 more"."""
    return f"row{'s' if len(rows) > 1 else ''} {list_names(rows[:SHOWN].astype(str).tolist(), len(rows))}"
