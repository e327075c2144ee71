"""Lines on stdout and stderr: whatever the names in them hold, no terminal obeys it and no encoding fails on it."""

import re
import sys
from contextlib import suppress
from io import TextIOWrapper

import click

from thenar.drivers.names import printable

# What stays as it is: lines may be several, and tabs part their columns.
_LAYOUT = re.compile(r"([\n\t])")
# What JSON does not escape, and a terminal or an encoding may not take.
_DOUBTFUL = re.compile(r"[^\n -~]")


def shown(text: str) -> str:
    """Return `text` for a terminal: characters without a glyph escaped as in Python, except line breaks and tabs."""
    if text.isprintable():
        return text
    return "".join(part if part in ("\n", "\t") else printable(part) for part in _LAYOUT.split(text))


def echo(text: str, *, err: bool = False) -> None:
    """Print `text` and a line break on stdout, or with `err` on stderr."""
    # Left to choose, click writes UTF-8 to a stream that is ASCII.
    click.echo(shown(text), file=sys.stderr if err else sys.stdout)


def echo_json(text: str) -> None:
    """Print a JSON document on stdout, as `json_shown` has it."""
    click.echo(json_shown(text, getattr(sys.stdout, "encoding", None) or "utf-8"), file=sys.stdout)


def json_shown(text: str, encoding: str) -> str:
    """Return the JSON document `text`, with JSON's escapes for characters without a glyph or outside `encoding`."""
    return _DOUBTFUL.sub(lambda found: _in_json(found[0], encoding), text)


def escape_the_unencodable() -> None:
    r"""Let stdout and stderr write what their encoding lacks as "\u2603", in place of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            with suppress(ValueError):  # closed
                stream.reconfigure(errors="backslashreplace")


def _in_json(letter: str, encoding: str) -> str:
    with suppress(UnicodeEncodeError):
        letter.encode(encoding)
        if letter.isprintable():
            return letter
    units = letter.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at]:02x}{units[at + 1]:02x}" for at in range(0, len(units), 2))
