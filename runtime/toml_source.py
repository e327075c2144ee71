"""A TOML file with its lines: errors name line and keys. All TOML that thenar reads is read here."""

import codecs
import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec import Struct, field

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
        lines = _Lines(list(_tokens(self.text))).walk()
        return next(lines[place[:end]] for end in range(len(place), -1, -1) if place[:end] in lines)


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


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    """Yield the pieces of TOML that are not blank, with their lines."""
    line = 1
    for found in _TOKEN.finditer(text):
        if found.lastgroup != "blank":
            yield found[0], line
        line += found[0].count("\n")


class _Lines(Struct):
    """Walks through the tokens of a valid TOML file and records the line of every table, key and list entry."""

    tokens: list[tuple[str, int]]
    lines: dict[Place, int] = field(default_factory=lambda: {(): 1})
    counts: Counter[Place] = field(default_factory=Counter)  # of the tables under every [[header]] so far
    next: int = 0

    def walk(self) -> dict[Place, int]:
        table: Place = ()
        while self._here():
            if self._passed("["):
                table = self._header()
            elif not self._passed("\n"):
                self._pair(table)
        return self.lines

    def _here(self) -> str:
        return self.tokens[self.next][0] if self.next < len(self.tokens) else ""

    def _passed(self, *marks: str) -> bool:
        passed = self._here() in marks
        self.next += passed
        return passed

    def _header(self) -> Place:
        """Pass `a.b]` or `[a.b]]`; return the table's place."""
        line, many = self.tokens[self.next][1], self._passed("[")
        place = self._key(())
        if many:
            self.counts[place] += 1
            place = (*place, self.counts[place] - 1)
        self.lines[place] = line
        self.next += 1 + many
        return place

    def _pair(self, table: Place) -> None:
        place = self._key(table)
        self.next += 1  # the equals sign
        self._value(place)

    def _key(self, place: Place) -> Place:
        """Pass a dotted key and record every table on its way; for a list of tables, the last one counts."""
        while True:
            token, line = self.tokens[self.next]
            self.next += 1
            place = (*place, _unquoted(token))
            self.lines.setdefault(place, line)
            if not self._passed("."):
                return place
            if place in self.counts:
                place = (*place, self.counts[place] - 1)

    def _value(self, place: Place) -> None:
        if self._passed("["):
            number = 0
            while not self._passed("]"):
                if not self._passed(",", "\n"):
                    self.lines[(*place, number)] = self.tokens[self.next][1]
                    self._value((*place, number))
                    number += 1
        elif self._passed("{"):
            while not self._passed("}"):
                if not self._passed(",", "\n"):
                    self._pair(place)
        else:
            while self._here() not in (",", "]", "}", "\n", ""):
                self.next += 1


def _unquoted(key: str) -> str:
    """Return the text of a bare or quoted key."""
    return next(iter(tomllib.loads(f"{key} = 0"))) if key[0] in "\"'" else key
