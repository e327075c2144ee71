"""Names: their rules, and how messages show, list and suggest them."""

from collections.abc import Sequence

from thenar.drivers.names import LONGEST_NAME, LONGEST_SHOWN, fault, printable, shortened, sound_name

__all__ = [
    "LONGEST_NAME",
    "LONGEST_SHOWN",
    "SHOWN",
    "fault",
    "level_name",
    "list_names",
    "nearest",
    "of_device",
    "printable",
    "shortened",
    "sound_name",
    "taxel_and_code",
]

SHOWN = 5
_CODE_DIGITS = 5
# At most this many names are compared with an unknown one.
MOST_COMPARED = 1000


def of_device(name: str, state: str) -> str:
    """Return `state` as a sentence about the device `name`, naming its port only once."""
    kind, _, port = name.partition(" at ")
    return f"{kind if port and port in state else name}: {state}"


def nearest(name: str, names: Sequence[str]) -> str:
    """Return " (did you mean ...?)" with the names most like `name`, or the first of `names` if none is near."""
    import difflib  # for messages only

    near = difflib.get_close_matches(name[:LONGEST_SHOWN], names[:MOST_COMPARED], n=3, cutoff=0.5)
    if near:
        return f" (did you mean {' or '.join(map(repr, near))}?)"
    return f" (there are: {list_names([*map(shortened, names[:SHOWN])], len(names))})"


def list_names(names: Sequence[str], count: int | None = None) -> str:
    """Return the first few names and the number of further ones out of `count`: "a, b, c, d, e and 7 more".

    `names` need only hold the first SHOWN if their `count` is given.
    """
    total = len(names) if count is None else count
    more = f" and {total - SHOWN} more" if total > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def level_name(taxel: str, code: int) -> str:
    """Return the name of a level: of the bit that is set if a taxel's code is above `code`."""
    return f"{taxel}>{code}"


def taxel_and_code(name: str) -> tuple[str, int] | None:
    """Return the taxel and the code in the name of a level, as made by `level_name`, or None for other names."""
    taxel, _, code = name.rpartition(">")
    return (taxel, int(code)) if taxel and code.isascii() and code.isdecimal() and len(code) <= _CODE_DIGITS else None
