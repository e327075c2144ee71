"""A TOML file with its lines: errors name line and keys. All TOML that thenar reads is read here."""

import codecs
import math
import re
import tomllib
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from .errors import ThenarError
from .files import read_file
from .names import shortened

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

# Bytes. A harness of 4,096 switches takes a third of it; reading longer files costs more than rejecting them.
LARGEST = 1_000_000
# Characters of an error's reason, which may quote the file.
_LONGEST_REASON = 400

# Nested lists and tables, and parts of a dotted key: the parser recurses at every level, and its time grows with both.
_DEEPEST = 10
# Digits of a number.
_LONGEST_NUMBER = 1000

# A place in a file: keys, and list indices from 0.
Place = tuple[str | int, ...]

_CLOSING = {"[": "]", "{": "}"}

# Every quantifier is possessive: an unclosed text is scanned once, not tried again from every quote in it.
_TOKEN = re.compile(
    r"""(?P<blank>[ \t\r]++|\#[^\n]*+)|(?P<mark>[][{}=,.\n])|(?P<word>[^][\s{}=,."'\#]++)
    |\"\"\"(?:[^"\\]++|\\.|"(?!""))*+(?:\"{3,5})?+|'''(?:[^']++|'(?!''))*+(?:'{3,5})?+
    |"(?:[^"\\\n]++|\\.)*+"?+|'[^'\n]*+'?+""",
    re.VERBOSE | re.DOTALL,
)


class TomlText(Struct, frozen=True):
    """The text of a TOML file, its name in messages, and the kind of error that it raises."""

    name: str
    text: str
    raises: type[ThenarError]

    def tables(self) -> dict[str, object]:
        """Return the content of the file; raises its error, with the line, if it is not TOML, exceeds a limit, or has a
        number that is not finite.
        """
        if len(self.text) > LARGEST:
            raise self.raises(f"{self.name} is longer than {LARGEST} characters, the limit for TOML: shorten it")
        try:
            _check_nesting(self.text)
            tables = tomllib.loads(self.text)
        except ValueError as reason:
            raise self.raises(f"{self.name} is not valid TOML: {shortened(str(reason), _LONGEST_REASON)}") from reason
        self._check_finite((), tables)
        return tables

    def _check_finite(self, place: Place, value: object) -> None:
        if isinstance(value, float) and not math.isfinite(value):
            raise self.error(place, f"must be a finite number, not {value}")
        inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        for key, item in inside:
            self._check_finite((*place, key), item)

    def error(self, place: Place, reason: str) -> ThenarError:
        """Return an error about the entry at `place`: "scene.toml, line 7: subjects[0].name: ..."."""
        where = f"{spelled(place)}: " if place else ""
        shown = shortened(reason, _LONGEST_REASON)
        return self.raises(f"{self.name}, line {self.line(place)}: {where}{shown}")

    def line(self, place: Place) -> int:
        """Return the line of `place`, counted from 1, or of the innermost table around it that exists."""
        table: Place = ()
        line, deepest, counts = 1, 0, Counter[Place]()
        for first, lines in _statements(self.text):
            content: Any = _begun(lines)
            heads = lines[0].lstrip().startswith("[")
            if heads:
                table, content = _headed(content, counts), {}
            for key in reversed(table):
                content = {key: content}
            depth = _depth(content, place)
            if depth > deepest or (heads and depth == deepest == len(table)):
                # A value may take several lines: the first of them by which it has these keys is the line.
                rest = place[len(table) :]
                more = bisect_left(
                    range(1, len(lines)), depth - len(table), key=lambda end: _depth(_begun(lines[:end]), rest)
                )
                line, deepest = first + more, depth
        return line


def read_source(file: "Traversable", raises: type[ThenarError]) -> TomlText:
    """Read a TOML file. Raises an error of the kind `raises` if it cannot be opened, is too large or not UTF-8."""
    try:
        # Files shipped with thenar may lie in a zip, which has no paths.
        data = read_file(file, LARGEST, raises) if isinstance(file, Path) else file.read_bytes()
        return TomlText(file.name, data.removeprefix(codecs.BOM_UTF8).decode(), raises)
    except UnicodeDecodeError as reason:
        before = reason.object[: reason.start].count(b"\n")
        raise raises(f"{file.name}, line {before + 1}: the text is not UTF-8: save it as UTF-8") from reason
    except OSError as reason:
        raise raises(f"{file}: cannot be read: {reason.strerror}") from reason


def _check_nesting(text: str) -> None:
    """Raise ValueError for what would take the parser minutes: deep nesting, or a long number."""
    depth = dots = 0
    for found in _TOKEN.finditer(text):
        mark, word = found["mark"], found["word"]
        if mark == ".":
            dots += 1
        elif mark is not None:
            dots = 0
            depth += (mark in "[{") - (mark in "]}")
        elif word is not None and len(word) > _LONGEST_NUMBER:
            raise ValueError(f"a key or a number is longer than {_LONGEST_NUMBER} digits")
        if depth > _DEEPEST or dots > _DEEPEST:
            raise ValueError(f"lists, tables or dotted keys nest deeper than {_DEEPEST} levels")


def spelled(place: Place) -> str:
    """Return `place` in TOML's notation: ("subjects", 0, "name") is "subjects[0].name"."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{shortened(key)}" for key in place).removeprefix(".")


def _statements(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield headers, keys with their values, and lines without any: each one's first line, and its lines."""
    start = line = open_lists = 0
    for found in _TOKEN.finditer(f"{text}\n"):
        open_lists += (found[0] in ("[", "{")) - (found[0] in ("]", "}"))
        if found[0] == "\n" and not open_lists:
            lines = text[start : found.start()].split("\n")
            yield line + 1, lines
            start, line = found.end(), line + len(lines)


def _headed(content: Any, counts: Counter[Place]) -> Place:
    """Return the place of the table that a header, read by itself, begins; `counts` are of the lists' tables so far."""
    place: Place = ()
    while content:
        ((key, content),) = content.items()
        place = (*place, key)
        if isinstance(content, list):
            counts[place], content = counts[place] + 1, {}
        if place in counts:
            place = (*place, counts[place] - 1)
    return place


def _depth(value: Any, place: Place) -> int:
    """Return how many keys of a place, from its first, a table has."""
    for depth, key in enumerate(place):
        try:
            value = value[key]
        except (KeyError, IndexError, TypeError):
            return depth
    return len(place)


def _begun(lines: Sequence[str]) -> dict[str, object]:
    """Return the content of the first lines of a valid file: what they open, lists, tables and a text, is closed."""
    text, token, closing = "".join(f"{line}\n" for line in lines), "", list[str]()
    for found in _TOKEN.finditer(text):
        token = found[0]
        if token in _CLOSING:
            closing.append(_CLOSING[token])
        elif closing and token == closing[-1]:
            closing.pop()
    # A text that is not closed takes the last line feed, too.
    quotes = token[:3] if token[:3] in ('"""', "'''") and token.endswith("\n") else ""
    return tomllib.loads(text + quotes + "".join(reversed(closing)))
