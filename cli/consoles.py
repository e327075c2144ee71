"""rich's console and table, safe for terminals and without truncation."""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.measure import Measurement
from rich.segment import Segment
from rich.table import Column, Table
from rich.text import Text

from thenar.drivers.names import shown

_UNBOUNDED, _READABLE = 10_000, 24


class SafeConsole(Console):
    """A console that escapes control characters in names; styles are rich's."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text."""
        # Escaped before it is measured, so that column widths fit.
        return super().render_str(shown(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """Yield the pieces of what is printed."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(shown(segment.text), segment.style)


class WholeTable(Table):
    """A table that truncates nothing: one that is too wide is split into several, each with the first column."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines of each part."""
        room = options.max_width - 1
        widths = [self._width(column, console, options) for column in self.columns]
        parts: list[list[int]] = [[]]
        for number, width in enumerate(widths):
            used = width + sum(widths[other] for other in parts[-1])
            if len(parts[-1]) > 1 and used > room:
                parts.append([0])
            parts[-1].append(number)
        for numbers in parts:
            part = self._part([self.columns[number] for number in numbers])
            part.title = self.title if numbers is parts[0] else None
            yield from Table.__rich_console__(part, console, options)

    def _part(self, columns: Sequence[Column]) -> "WholeTable":
        part = copy(self)
        part.columns = [replace(column, _index=index) for index, column in enumerate(columns)]
        return part

    def _width(self, column: Column, console: Console, options: ConsoleOptions) -> int:
        """Return the width that a column needs with one line: words wrap, but not to one word per line."""
        needed = Measurement.get(console, options.update_width(_UNBOUNDED), self._part([column]))
        most = needed.maximum if column.no_wrap else max(needed.minimum, min(needed.maximum, _READABLE))
        return most - 1
