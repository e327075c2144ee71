"""Names that survive every file format: of columns, grasp types, subjects and objects; and how messages list them."""

import difflib
import unicodedata
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from .errors import RecordingError

SHOWN = 5


def check_names(what: str, names: Iterable[str]) -> None:
    """Raise RecordingError unless `names` are distinct, not empty, and free of control characters and outer blanks."""
    seen: set[str] = set()
    for name in names:
        if reason := fault(name):
            raise RecordingError(f"{what} {name!r} {reason}")
        if name in seen:
            raise RecordingError(f"{what} {name!r} occurs twice")
        seen.add(name)


def nearest(name: str, names: Sequence[str]) -> str:
    """Return " (did you mean ...?)" with the names most like `name`, or the first of `names` when none is near."""
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    return f" (did you mean {' or '.join(map(repr, near))}?)" if near else f" (there are: {list_names(names)})"


def list_names(names: Sequence[str], count: int | None = None) -> str:
    """Return the first few names and how many more of `count` there are: "a, b, c, d, e and 7 more".

    `names` need hold no more than the first SHOWN when their `count` is given.
    """
    total = len(names) if count is None else count
    more = f" and {total - SHOWN} more" if total > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def list_rows(rows: NDArray[np.int64]) -> str:
    """Return "row 3" or "rows 3, 4, 5, 6, 7 and 7 more"."""
    return f"row{'s' if len(rows) > 1 else ''} {list_names(rows.astype(str).tolist())}"


def fault(name: str) -> str:
    """Return why `name` would not survive every file format, or nothing."""
    if not name:
        return "is empty"
    if name == "?":
        return "means a missing value in every table"
    if name != name.strip():
        return "begins or ends with a blank"
    # Cc: control characters; Cs: halves of surrogate pairs, which UTF-8 cannot hold.
    if any(unicodedata.category(letter) in ("Cc", "Cs") for letter in name):
        return "holds a control character"
    return ""
