"""Names: the rule for them, and how messages show, list and suggest them."""

import difflib
from collections.abc import Sequence

from thenar.drivers.names import LONGEST_NAME, LONGEST_SHOWN, fault, printable, shortened, sound_name

__all__ = [
    "LONGEST_NAME",
    "LONGEST_SHOWN",
    "SHOWN",
    "fault",
    "list_names",
    "nearest",
    "printable",
    "shortened",
    "sound_name",
]

SHOWN = 5
# At most this many names are compared with one that is not among them.
MOST_COMPARED = 1000


def nearest(name: str, names: Sequence[str]) -> str:
    """Return " (did you mean ...?)" with the names most like `name`, or the first of `names` when none is near."""
    near = difflib.get_close_matches(name[:LONGEST_SHOWN], names[:MOST_COMPARED], n=3, cutoff=0.5)
    if near:
        return f" (did you mean {' or '.join(map(repr, near))}?)"
    return f" (there are: {list_names([shortened(known) for known in names[:SHOWN]], len(names))})"


def list_names(names: Sequence[str], count: int | None = None) -> str:
    """Return the first few names and how many more of `count` there are: "a, b, c, d, e and 7 more".

    `names` need hold no more than the first SHOWN when their `count` is given.
    """
    total = len(names) if count is None else count
    more = f" and {total - SHOWN} more" if total > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
