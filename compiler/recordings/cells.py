"""The cells of a column as numbers, bits, codes and names, and which of them are missing or invalid."""

import math
import re
from contextlib import suppress
from dataclasses import dataclass
from itertools import compress
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import fault

from ..text import text_of
from .arrays import AnyArray
from .errors import check_room
from .graspset import CODES
from .headers import MISSING_NUMBERS
from .table import Column, is_numeric, pieces

MISSING_NAMES = frozenset({"", "?"})

_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d(?:\.\d{1,9})?)?")
_BITS = {"true": 1.0, "false": 0.0}

Value = TypeVar("Value", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Parsed(Generic[Value]):
    """One column: (n,) `values`, and which cells are missing and which are wrong, (n,) bool each."""

    values: NDArray[Value]
    missing: NDArray[np.bool_]
    wrong: NDArray[np.bool_]


def numbers(column: Column, decimal: str = ".") -> Parsed[np.float64]:
    """Read `column` as finite numbers with the decimal sign `decimal`.

    Missing: empty, ?, NA, N/A, NaN, null, none; wrong: anything else, and infinity.
    """
    return _parsed(column, {}, decimal)


def bits(column: Column, decimal: str = ".") -> Parsed[np.bool_]:
    """Read `column` as bits: 0, 1, 0.0, 1.0, true, false; missing as in `numbers`, wrong: anything else."""
    parsed = _parsed(column, _BITS, decimal)
    values = parsed.values == 1
    return Parsed(values, parsed.missing, parsed.wrong | ~(parsed.missing | values | (parsed.values == 0)))


def integers(column: Column, decimal: str = ".") -> Parsed[np.float64]:
    """Read `column` as whole numbers within +-2^53; missing as in `numbers`, wrong: anything else."""
    parsed = numbers(column, decimal)
    values = np.where(parsed.missing | parsed.wrong, 0, parsed.values)
    return Parsed(values, parsed.missing, parsed.wrong | (values != np.rint(values)) | (np.abs(values) > 2**53))


def codes(column: Column, decimal: str = ".") -> Parsed[np.float64]:
    """Read `column` as codes 0..65535; missing as in `numbers`, wrong: anything else."""
    parsed = integers(column, decimal)
    return Parsed(parsed.values, parsed.missing, parsed.wrong | (parsed.values < 0) | (parsed.values >= CODES))


def times(column: Column, decimal: str = ".") -> Parsed[np.float64]:
    """Read `column` as finite numbers, or all of it as dates with times of day (ISO 8601, without offsets), in
    microseconds since 1970; missing as in `numbers`, wrong: anything else.
    """
    parsed = numbers(column, decimal)
    if not parsed.wrong.any() or is_numeric(column):
        return parsed
    texts = [text.strip().removesuffix("Z") for piece in pieces(column) for text in piece]
    if not all(map(_DATE.fullmatch, compress(texts, (~parsed.missing).tolist()))):
        return parsed
    try:
        stamps = np.array(["NaT" if gone else text for text, gone in zip(texts, parsed.missing, strict=True)], "M8[us]")
    except ValueError:
        return parsed
    values = np.where(parsed.missing, np.nan, stamps.astype(np.int64))
    return Parsed(values, parsed.missing, np.zeros(len(values), np.bool_))


def names(column: Column, cells: bool = False, size: int = 0) -> Parsed[np.str_]:
    """Read `column` as names without outer blanks; missing: empty and ?, wrong: invalid names.

    With `cells` they are written as cells of a spreadsheet. Numbers are names too, except NaN, which is missing, and
    infinity, which is wrong. Integers are written without decimals: 3, not 3.0. Raises RecordingError if the names are
    too long for the number of rows of a file of `size` bytes.
    """
    if is_numeric(column):
        values = _floats(column)
        texts = list(map(_name_of_number, values.tolist()))
        faulty = {"inf", "-inf"}
    else:
        texts = [text_of(cell.strip()) if cells else cell.strip() for piece in pieces(column) for cell in piece]
        faulty = {text for text in {*texts} - MISSING_NAMES if fault(text)}
    check_room(len(texts), max(map(len, texts), default=0), size)
    # Looked up as str: an array would lose NULs at the ends.
    missing, wrong = (
        np.fromiter((text in those for text in texts), np.bool_, len(texts)) for those in (MISSING_NAMES, faulty)
    )
    return Parsed(np.array(texts, np.str_), missing, wrong)


def _name_of_number(number: float) -> str:
    if math.isnan(number):
        return ""
    # Adding zero turns -0.0 into 0.0.
    return np.format_float_positional(number + 0.0, trim="-")


# "1.000" means a thousand where a comma is the decimal sign: so it is wrong, not one.
_COMMA = str.maketrans({",": ".", ".": "_"})


def _parsed(column: Column, words: dict[str, float], decimal: str) -> Parsed[np.float64]:
    """Return the cells as floats, NaN if missing or wrong; `words` are read in addition to numbers."""
    if is_numeric(column):
        values = _floats(column)
        missing = np.isnan(values)
    else:
        values, missing = np.empty(len(column)), np.zeros(len(column), np.bool_)
        start = 0
        for texts in pieces(column):
            end = start + len(texts)
            values[start:end] = _numbers([text.translate(_COMMA) for text in texts] if decimal == "," else texts, words)
            for row in np.flatnonzero(np.isnan(values[start:end])).tolist():
                missing[start + row] = texts[row].strip().casefold() in MISSING_NUMBERS
            start = end
    return Parsed(values, missing, (np.isnan(values) & ~missing) | np.isinf(values))


def _floats(column: AnyArray) -> NDArray[np.float64]:
    # A number too large for a double becomes infinite, and is rejected with its row.
    with np.errstate(over="ignore"):
        return column.astype(np.float64)


def _numbers(cells: list[str], words: dict[str, float]) -> NDArray[np.float64]:
    try:
        # Convert all at once, which is several times faster; float() would read 1_000 as a thousand.
        values = np.array(cells, dtype=np.float64)
        return values if not any("_" in cell for cell in cells) else _one_by_one(cells, words)
    except ValueError:
        return _one_by_one(cells, words)


def _one_by_one(cells: list[str], words: dict[str, float]) -> NDArray[np.float64]:
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        word = cell.strip().casefold()
        if word in words:
            values[row] = words[word]
        elif word not in MISSING_NUMBERS and "_" not in word:
            with suppress(ValueError):
                values[row] = float(word)
    return values
