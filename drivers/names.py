"""Names from files and devices: which are valid, and how to print them without terminal control sequences.

It is in `drivers` for the same reason as `errors`: every package uses names, and this one imports none.
"""

import re
import unicodedata

LONGEST_NAME = 200
# The longest excerpt of a foreign file in a message.
LONGEST_SHOWN = 80

# Control and format characters (a terminal executes some, others reorder a line), halves of surrogate pairs, and the
# separators of lines and paragraphs.
_UNSOUND = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
# Private and unassigned ones have no glyph, but do nothing either.
_UNPRINTABLE = _UNSOUND | {"Co", "Cn"}
# Persian, Hindi and many other languages spell words with these two, and emoji are joined by one.
_JOINERS = frozenset("\u200c\u200d")
# What a message of several lines has on purpose.
_LAYOUT = re.compile(r"([\n\t])")


def fault(name: str, longest: int = LONGEST_NAME) -> str:
    """Return why `name` would not survive every file format or would mislead a reader, or "".

    This is the only rule for names of switches, joints, grasp types, taxonomies, subjects, objects, sensors and gloves.
    `longest` is for texts that contain a name.
    """
    if not name:
        return "is empty"
    if name == "?":
        return "means a missing value in every table"
    if len(name) > longest:
        return f"has {len(name)} characters: at most {longest}"
    if name != name.strip():
        return "begins or ends with a blank"
    found = next(filter(_unsound, "" if name.isprintable() else name), None)
    return f"holds a control character (U+{ord(found):04X})" if found else ""


def sound_name(name: str, otherwise: str) -> str:
    """Return `name`, or `otherwise` if it is not a valid name: the stem of a file may be anything."""
    return otherwise if fault(name) else name


def printable(text: str) -> str:
    """Return `text` with every character without a glyph escaped as in Python, safe for terminals."""
    if text.isprintable():
        return text
    return "".join(
        letter.encode("unicode_escape").decode() if unicodedata.category(letter) in _UNPRINTABLE else letter
        for letter in text
    )


def shown(text: str) -> str:
    """Return `text` of several lines for a terminal: as `printable`, but with its newlines and tabs."""
    if text.isprintable():
        return text
    return "".join(part if part in ("\n", "\t") else printable(part) for part in _LAYOUT.split(text))


def shortened(text: str, longest: int = LONGEST_SHOWN) -> str:
    """Return a foreign `text` for a message: printable, and cut after `longest` characters."""
    return printable(text) if len(text) <= longest else f"{printable(text[:longest])}..."


def _unsound(letter: str) -> bool:
    # The last two of every plane are noncharacters: XML, HTML and SVG reject them.
    none = ord(letter) & 0xFFFE == 0xFFFE or 0xFDD0 <= ord(letter) <= 0xFDEF
    return none or (unicodedata.category(letter) in _UNSOUND and letter not in _JOINERS)
