"""Cells of text in little memory: a table's rows in blocks, each column of a block as one UTF-8 text.

A list of str takes 8 to 70 bytes a cell, which a hostile table has in one or two bytes of its file; here a cell takes
its own bytes and one or two for its length.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain
from typing import overload

import numpy as np
from numpy.typing import NDArray

# Cells that are held as str at a time, while a block is filled or a column is read.
_CELLS = 1 << 18
_READ = 1 << 14


@dataclass(frozen=True, slots=True)
class _Block:
    """Rows of a table, column after column: their `text`, where each column ends in it, and the cells' lengths."""

    rows: int
    text: bytes
    ends: NDArray[np.unsignedinteger]  # (columns,) bytes
    lengths: NDArray[np.unsignedinteger]  # (columns * rows,) characters

    def column(self, number: int) -> list[str]:
        """Return the cells of a column, in these rows."""
        start = int(self.ends[number - 1]) if number else 0
        text = self.text[start : int(self.ends[number])].decode()
        lengths = self.lengths[number * self.rows : (number + 1) * self.rows].tolist()
        if lengths.count(1) == self.rows:
            return list(text)
        return [text[end - length : end] for length, end in zip(lengths, accumulate(lengths), strict=True)]


class TextRows:
    """Takes the rows of a table of `width` columns, each a list of as many cells; then gives its columns."""

    def __init__(self, width: int) -> None:
        self._width = width
        self._rows: list[list[str]] = []
        self._blocks: list[_Block] = []

    def append(self, row: list[str]) -> None:
        """Take the next row."""
        self._rows.append(row)
        if len(self._rows) * self._width >= _CELLS:
            self._store()

    def columns(self) -> "list[TextColumn]":
        """Return the columns; no row is appended after that."""
        if self._rows:
            self._store()
        return [TextColumn(self._blocks, number) for number in range(self._width)]

    def _store(self) -> None:
        columns = list(zip(*self._rows, strict=True))
        texts = ["".join(column).encode() for column in columns]
        lengths = np.fromiter(map(len, chain.from_iterable(columns)), np.uint32, len(self._rows) * self._width)
        self._blocks.append(
            _Block(
                len(self._rows),
                b"".join(texts),
                _small(np.cumsum([*map(len, texts)], dtype=np.uint64)),
                _small(lengths),
            )
        )
        self._rows = []


class TextColumn(Sequence[str]):
    """One column of a table."""

    def __init__(self, blocks: list[_Block], number: int) -> None:
        self._blocks = blocks
        self._number = number

    def __len__(self) -> int:
        return sum(block.rows for block in self._blocks)

    def __iter__(self) -> Iterator[str]:
        return chain.from_iterable(block.column(self._number) for block in self._blocks)

    @overload
    def __getitem__(self, row: int) -> str: ...

    @overload
    def __getitem__(self, row: slice) -> list[str]: ...

    def __getitem__(self, row: int | slice) -> str | list[str]:
        if isinstance(row, slice):
            return list(self)[row]
        for block in self._blocks:
            if row < block.rows:
                return block.column(self._number)[row]
            row -= block.rows
        raise IndexError("the column has fewer rows")

    def pieces(self) -> Iterator[list[str]]:
        """Yield the cells in lists of some thousands, which are dearer to make than to walk through."""
        piece: list[str] = []
        for block in self._blocks:
            piece += block.column(self._number)
            if len(piece) >= _READ:
                yield piece
                piece = []
        if piece:
            yield piece


def pieces(column: Sequence[str] | NDArray[np.generic]) -> Iterator[list[str]]:
    """Yield the cells of a column of text, in whatever it is, in lists of some thousands."""
    if isinstance(column, TextColumn):
        yield from column.pieces()
        return
    for start in range(0, len(column), _READ):
        piece = column[start : start + _READ]
        yield piece.tolist() if isinstance(piece, np.ndarray) else list(piece)


def _small(numbers: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    """Return `numbers` in as few bytes as hold their largest."""
    return numbers.astype(np.min_scalar_type(int(numbers.max(initial=0))))
