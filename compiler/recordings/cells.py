"""Cells of a table as numbers, bits or names; what is missing and what is wrong is marked, not raised."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from .graspset import CODES
from .names import fault
from .spreadsheet import text_of
from .table import Column

MISSING_NUMBERS = frozenset({"", "?", "na", "nan"})
MISSING_NAMES = frozenset({"", "?"})

_BITS = {"true": 1.0, "false": 0.0}


Value = TypeVar("Value", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Parsed(Generic[Value]):
    """One column: (n,) `values`, and which cells are missing and which are wrong, (n,) bool each."""

    values: NDArray[Value]
    missing: NDArray[np.bool_]
    wrong: NDArray[np.bool_]


def numbers(column: Column) -> Parsed[np.float64]:
    """Read `column` as finite numbers; missing: empty, ?, NA, NaN; wrong: anything else, and infinity."""
    values = _floats(column, {})
    return _parsed(values, column)


def bits(column: Column) -> Parsed[np.float64]:
    """Read `column` as bits: 0, 1, 0.0, 1.0, true, false; missing as in `numbers`, wrong: anything else."""
    values = _floats(column, _BITS)
    parsed = _parsed(values, column)
    return Parsed(values, parsed.missing, parsed.wrong | ~(parsed.missing | (values == 0) | (values == 1)))


def integers(column: Column) -> Parsed[np.float64]:
    """Read `column` as whole numbers within +-2^53; missing as in `numbers`, wrong: anything else."""
    parsed = numbers(column)
    values = np.where(parsed.missing | parsed.wrong, 0, parsed.values)
    return Parsed(values, parsed.missing, parsed.wrong | (values != np.rint(values)) | (np.abs(values) > 2**53))


def codes(column: Column) -> Parsed[np.float64]:
    """Read `column` as codes 0..65535; missing as in `numbers`, wrong: anything else."""
    parsed = integers(column)
    return Parsed(parsed.values, parsed.missing, parsed.wrong | (parsed.values < 0) | (parsed.values >= CODES))


def names(column: Column, cells: bool = False) -> Parsed[np.str_]:
    """Read `column` as names without outer blanks; missing: empty and ?, wrong: what is no good name. With `cells` they
    are written as cells of a spreadsheet.

    Numbers are names too, but for NaN, which is missing, and infinity, which is wrong. Whole ones read as such: 3, not
    3.0.
    """
    if isinstance(column, np.ndarray):
        texts = list(map(_name_of_number, column.tolist()))
        faulty = {text for text in texts if text.endswith("inf")}
    else:
        texts = [text_of(cell.strip()) if cells else cell.strip() for cell in column]
        # Looked up as str: an array of them would lose NULs at their ends.
        faulty = {text for text in {*texts} - MISSING_NAMES if fault(text)}
    missing, wrong = (np.array([text in found for text in texts], np.bool_) for found in (MISSING_NAMES, faulty))
    return Parsed(np.array(texts, np.str_), missing, wrong)


def _name_of_number(number: float) -> str:
    if math.isnan(number):
        return ""
    # Adding zero makes -0.0 the 0.0 that it equals.
    return np.format_float_positional(number + 0.0, trim="-")


def _parsed(values: NDArray[np.float64], column: Column) -> Parsed[np.float64]:
    """Tell the missing cells from the wrong ones, both of which `_floats` left as NaN."""
    doubtful = np.isnan(values)
    missing = doubtful.copy()
    if not isinstance(column, np.ndarray):
        for row in np.flatnonzero(doubtful).tolist():
            missing[row] = column[row].strip().casefold() in MISSING_NUMBERS
    return Parsed(values, missing, (doubtful & ~missing) | np.isinf(values))


def _floats(column: Column, words: dict[str, float]) -> NDArray[np.float64]:
    """Return the cells as floats, NaN where one is none; `words` are read besides numbers."""
    if isinstance(column, np.ndarray):
        return column
    try:
        # The whole column at once is several times faster; float() would read 1_000 as a thousand.
        values = np.array(column, dtype=np.float64)
        return values if not any("_" in cell for cell in column) else _one_by_one(column, words)
    except ValueError:
        return _one_by_one(column, words)


def _one_by_one(column: Sequence[str], words: dict[str, float]) -> NDArray[np.float64]:
    values = np.full(len(column), np.nan)
    for row, cell in enumerate(column):
        try:
            word = cell.strip().casefold()
            values[row] = words[word] if word in words else float("nan" if "_" in cell else cell)
        except ValueError:
            continue
    return values
