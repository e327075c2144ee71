"""Lines on stdout and stderr, safe for terminals and encodings whatever the names in them hold."""

import re
import sys
from contextlib import suppress
from io import TextIOWrapper

import click

from thenar.drivers.names import shown

# Left unescaped by JSON, but perhaps unsafe for a terminal or an encoding.
_DOUBTFUL = re.compile(r"[^\n -~]")


def echo(text: str, *, err: bool = False) -> None:
    """Print `text` and a newline on stdout, or with `err` on stderr."""
    # By default, click writes UTF-8 to a stream that is ASCII.
    click.echo(shown(text), file=sys.stderr if err else sys.stdout)


def echo_json(text: str) -> None:
    """Print a JSON document on stdout, escaped by `json_shown`."""
    click.echo(json_shown(text, getattr(sys.stdout, "encoding", None) or "utf-8"), file=sys.stdout)


def json_shown(text: str, encoding: str) -> str:
    """Return the JSON document `text`, with JSON escapes for characters without a glyph or outside `encoding`."""
    return _DOUBTFUL.sub(lambda found: _in_json(found[0], encoding), text)


def escape_the_unencodable() -> None:
    r"""Make stdout and stderr write unencodable characters as "\u2603" instead of failing."""
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
