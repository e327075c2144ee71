"""Names: what would not survive a file format, and how messages show, list and suggest them."""

import difflib
import unicodedata
from collections.abc import Sequence

SHOWN = 5
# The longest piece of a foreign file that a message repeats.
LONGEST_SHOWN = 80
# So many names are compared with one that is not among them.
MOST_COMPARED = 1000

# Control and format characters (a terminal obeys some, others reorder a line), halves of surrogate pairs, private and
# unassigned ones, and the separators of lines and paragraphs.
_UNPRINTABLE = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})


def printable(text: str) -> str:
    """Return `text` with every character that is no glyph written as Python would, so that no terminal obeys it."""
    return "".join(
        letter.encode("unicode_escape").decode() if unicodedata.category(letter) in _UNPRINTABLE else letter
        for letter in text
    )


def shortened(text: str, longest: int = LONGEST_SHOWN) -> str:
    """Return what a message repeats of a foreign `text`: printable, and cut behind `longest` characters."""
    return printable(text) if len(text) <= longest else f"{printable(text[:longest])}..."


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
