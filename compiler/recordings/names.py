"""Names of columns, grasp types, subjects and objects: those that survive every file format; and rows in messages."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...runtime.names import SHOWN, fault, list_names, nearest, shortened
from .errors import RecordingError

__all__ = ["SHOWN", "check_names", "fault", "list_names", "list_rows", "nearest"]


def check_names(what: str, names: Iterable[str]) -> None:
    """Raise RecordingError unless `names` are distinct, not empty, and free of control characters and outer blanks."""
    seen: set[str] = set()
    for name in names:
        if reason := fault(name):
            raise RecordingError(f"{what} {shortened(repr(name))} {reason}")
        if name in seen:
            raise RecordingError(f"{what} {shortened(repr(name))} occurs twice")
        seen.add(name)


def list_rows(rows: NDArray[np.int64]) -> str:
    """Return "row 3" or "rows 3, 4, 5, 6, 7 and 7 more"."""
    return f"row{'s' if len(rows) > 1 else ''} {list_names(rows[:SHOWN].astype(str).tolist(), len(rows))}"
