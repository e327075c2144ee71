"""Words of a build as words of C: names, comments and string literals, whatever characters they are made of."""

import re

from .errors import FirmwareError

_LONGEST_NAME = 32


def check_name(name: str) -> None:
    """Raise FirmwareError unless `name` can be what files and functions of C are called: thenar_NAME."""
    if not re.fullmatch(rf"[a-z][a-z0-9_]{{0,{_LONGEST_NAME - 1}}}", name):
        raise FirmwareError(
            f"{name!r} cannot be the name: it takes lower-case letters a to z, digits and _, a letter first, "
            f"at most {_LONGEST_NAME}"
        )


def inputs_in_words(switches: int, joints: int) -> str:
    """Return how many inputs there are, leaving out what there is none of: "31 switches and 1 joint"."""
    counts = ((switches, "switch", "switches"), (joints, "joint", "joints"))
    return " and ".join(f"{count} {one if count == 1 else more}" for count, one, more in counts if count)


def comment(text: str) -> str:
    """Return `text` in one line of ASCII that can stand inside a C comment: it neither ends nor opens one."""
    escaped = "".join(char if " " <= char <= "~" else _escape(char) for char in text)
    # A backslash at the end of a line, or the trigraph for one, would continue a comment of the // kind.
    return escaped.replace("*/", "* /").replace("/*", "/ *").replace("??/", "? ?/")


def markdown(text: str) -> str:
    """Return `text` in one line of ASCII that Markdown shows as it is, and takes for nothing else."""
    return re.sub(r"([\\`*_{}\[\]<>()#!|&~])", r"\\\1", comment(text))


def string(text: str) -> str:
    """Return the literal of C that is `text` in UTF-8."""
    return '"' + "".join(_in_literal(byte) for byte in text.encode()) + '"'


def _escape(char: str) -> str:
    code = ord(char)
    return f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}" if code < 65536 else f"\\U{code:08x}"


def _in_literal(byte: int) -> str:
    if 32 <= byte < 127 and chr(byte) not in '"\\?':
        return chr(byte)
    return f"\\{byte:03o}"
