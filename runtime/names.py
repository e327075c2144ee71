"""Names: what would not survive a file format, and how messages list names and suggest the nearest."""

import difflib
import unicodedata
from collections.abc import Sequence

SHOWN = 5


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
