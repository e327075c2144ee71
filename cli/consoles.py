"""What people see: texts with a style, tables that truncate nothing, and views that are drawn in place.

Names are escaped, so that a terminal obeys nothing in them. Only a terminal gets styles and views.
"""

import os
import re
import shutil
import sys
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import IO, NamedTuple
from unicodedata import combining, east_asian_width

from thenar.drivers.closing import Closing
from thenar.drivers.names import shown

_STYLES = {"bold": "1", "dim": "2", "red": "31", "green": "32", "yellow": "33", "cyan": "36"}
# A column is at least this wide, if its longest cell is: words wrap, but not to one word a line.
_READABLE = 24


class Text(NamedTuple):
    """A text in a style such as "bold green"."""

    text: str = ""
    style: str = ""

    def lines(self, width: int) -> Iterator[str]:
        """Yield its lines, as a terminal gets them."""
        return (_styled(line, self.style) for line in wrapped(shown(self.text), width))


@dataclass
class Table:
    """A table. One that is too wide is split into several, each with the first column; a `grid` has no frame.

    Columns with heads in `numbers` are aligned right, and their cells are never wrapped.
    """

    heads: list[str]
    numbers: Container[str] = ()
    title: str | None = None
    grid: bool = False
    rows: list[list[Text]] = field(default_factory=list)

    def add_row(self, *cells: str | Text, style: str = "") -> None:
        """Add a row; `style` is that of its texts without one."""
        self.rows.append(
            [
                Text(shown(cell.text), cell.style) if isinstance(cell, Text) else Text(shown(cell), style)
                for cell in cells
            ]
        )

    def lines(self, width: int) -> Iterator[str]:
        """Yield the lines of each part."""
        heads = [Text(shown(head), "bold") for head in self.heads]
        columns = [[row[number].text for row in (heads, *self.rows)] for number in range(len(heads))]
        naturals = [max(map(cells, "\n".join(texts).split("\n"))) for texts in columns]
        if self.grid:
            for row in self.rows:
                yield from ("    ".join(line).rstrip() for line in self._laid_out(row, range(len(row)), naturals))
            return
        needed = [
            natural if head in self.numbers else max(min(natural, _READABLE), *map(cells, "\n".join(texts).split()), 0)
            for head, texts, natural in zip(self.heads, columns, naturals, strict=True)
        ]
        if self.title is not None:
            yield from Text(self.title, "bold").lines(width)
        parts: list[list[int]] = [[]]
        for number in range(len(heads)):
            if len(parts[-1]) > 1 and _framed(needed[each] for each in (*parts[-1], number)) > width:
                parts.append([0])
            parts[-1].append(number)
        for part in parts:
            widths, spare = dict[int, int](), max(width - _framed(needed[number] for number in part), 0)
            for number in part:
                widths[number] = min(needed[number] + spare, naturals[number])
                spare -= widths[number] - needed[number]
            while _framed(widths.values()) > width and max(widths.values()) > 1:
                widths[max(part, key=widths.__getitem__)] -= 1  # a word wider than the terminal is folded
            yield from self._part(heads, part, [widths.get(number, 0) for number in range(len(heads))])

    def _part(self, heads: Sequence[Text], part: Sequence[int], widths: Sequence[int]) -> Iterator[str]:
        rules = ["━" * (widths[number] + 2) for number in part]
        yield f"┏{'┳'.join(rules)}┓"
        yield from (f"┃ {' ┃ '.join(line)} ┃" for line in self._laid_out(heads, part, widths))
        yield f"┡{'╇'.join(rules)}┩"
        for row in self.rows:
            yield from (f"│ {' │ '.join(line)} │" for line in self._laid_out(row, part, widths))
        yield f"└{'┴'.join(rules)}┘".replace("━", "─")

    def _laid_out(self, row: Sequence[Text], part: Iterable[int], widths: Sequence[int]) -> Iterator[list[str]]:
        """Yield the cells of each line of a row, as wide as their columns."""
        lines = {number: [*wrapped(row[number].text, widths[number])] for number in part}
        for at in range(max(map(len, lines.values()))):
            found = []
            for number, texts in lines.items():
                text = texts[at] if at < len(texts) else ""
                blank, styled = " " * (widths[number] - cells(text)), _styled(text, row[number].style)
                found.append(blank + styled if self.heads[number] in self.numbers else styled + blank)
            yield found


Printed = str | Text | Table


def grid(columns: int) -> Table:
    """Return a table without a frame and heads."""
    return Table([""] * columns, grid=True)


def cells(text: str) -> int:
    """Return how many cells of a terminal a text takes: two for a wide letter, none for a mark on another one."""
    if text.isascii():
        return len(text)
    return sum(0 if combining(letter) else 2 if east_asian_width(letter) in "WF" else 1 for letter in text)


def wrapped(text: str, width: int) -> Iterator[str]:
    """Yield the lines of a text, broken between words, and within one that is longer than a line."""
    for paragraph in text.split("\n"):
        line = ""
        for word in re.findall(r"\s*\S+|\s+$", paragraph):
            if line and cells(line + word) > width:
                yield line
                line, word = "", word.lstrip()
            while cells(word) > width > 1:
                end = next(end for end in range(len(word), 0, -1) if cells(word[:end]) <= width)
                yield word[:end]
                word = word[end:]
            line += word
        yield line


def bar(share: float, width: int = 30) -> str:
    """Return a bar of which this share is full."""
    full = round(share * width)
    return "█" * full + "░" * (width - full)


def _framed(widths: Iterable[int]) -> int:
    return 1 + sum(width + 3 for width in widths)


def _styled(text: str, style: str) -> str:
    codes = ";".join(_STYLES[word] for word in style.split())
    return f"\x1b[{codes}m{text}\x1b[0m" if text and codes else text


class Console:
    """Prints to stdout, to stderr, or to a file."""

    def __init__(self, file: IO[str] | None = None, *, stderr: bool = False, width: int | None = None) -> None:
        self._file, self._stderr, self._width = file, stderr, width

    @property
    def file(self) -> IO[str] | None:
        """What it writes to; None if that is closed."""
        return self._file or (sys.stderr if self._stderr else sys.stdout)

    @property
    def is_terminal(self) -> bool:
        """Whether people read it, or FORCE_COLOR says so."""
        return bool(os.environ.get("FORCE_COLOR")) or (self.file is not None and self.file.isatty())

    @property
    def width(self) -> int:
        """The cells of a line."""
        return self._width or shutil.get_terminal_size().columns

    def print(self, printed: Printed = "", *, soft_wrap: bool = False) -> None:
        """Print something and an end of line; with `soft_wrap`, a text is not wrapped."""
        self.write("".join(f"{line}\n" for line in self.lines(printed, sys.maxsize if soft_wrap else self.width)))

    def lines(self, printed: Printed, width: int) -> Iterator[str]:
        """Yield the lines of something, with styles if a terminal gets them."""
        plain = not self.is_terminal or "NO_COLOR" in os.environ
        for line in (Text(printed) if isinstance(printed, str) else printed).lines(width):
            yield re.sub(r"\x1b\[[0-9;]*m", "", line) if plain else line

    def write(self, text: str) -> None:
        """Write a text as it is."""
        if self.file is not None:
            self.file.write(text)
            self.file.flush()


class Live(Closing):
    """A view on a terminal that is drawn in place, and gone at the end; elsewhere it does nothing."""

    def __init__(self, console: Console) -> None:
        self._console, self._back = console, ""

    def close(self) -> None:
        """End the view."""
        if self._back:
            self._console.write(f"{self._back}\x1b[?25h")
            self._back = ""

    def update(self, *printed: Printed) -> None:
        """Draw this instead of what was drawn last; what is higher than the terminal is cut off."""
        if not self._console.is_terminal:
            return
        most, width = shutil.get_terminal_size().lines - 1, self._console.width - 1
        lines = [line for each in printed for line in self._console.lines(each, width)][:most]
        # The cursor is hidden until the view is gone.
        self._console.write("\n".join([(self._back or "\x1b[?25l") + lines[0], *lines[1:], ""]))
        self._back = f"\x1b[{len(lines)}F\x1b[J"
