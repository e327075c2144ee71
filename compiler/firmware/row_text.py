"""Rows of numbers as lines of C, with a comment that says what they are the rows of."""

import textwrap
from collections.abc import Iterable, Sequence

import numpy as np

from thenar.runtime.manifest import Manifest

from .layout import Layout
from .lookups import Lookup, lookups
from .parts import Parts
from .words import comment

COLUMNS = 120
_INDENT = "    "
_NUMBERS_PER_LINE = 16


def table_lines(layout: Layout, manifest: Manifest, parts: Parts) -> list[str]:
    """Return the lines of the whole table: part after part, look-up after look-up."""
    lines = []
    for first in parts.firsts:
        columns = slice(first, first + parts.width)
        lines += remark("columns: " + ", ".join(map(comment, manifest.grasps[columns])))
        for lookup in lookups(layout):
            lines += _lookup_lines(layout, manifest, lookup, columns)
    return lines


def number_lines(numbers: Iterable[int]) -> list[str]:
    """Return lines of plain numbers, a multiple of 16 on each, separated by commas."""
    held = [str(number) for number in numbers]
    parts = [held[at : at + _NUMBERS_PER_LINE] for at in range(0, len(held), _NUMBERS_PER_LINE)]
    return [_INDENT + ", ".join(part) + "," for part in parts]


def remark(text: str) -> list[str]:
    """Return a comment as indented lines of at most 120 columns."""
    wrapped = textwrap.wrap(text, COLUMNS - 10, break_long_words=True, break_on_hyphens=False)
    inside = [f"{_INDENT}/* {wrapped[0]}", *(f"{_INDENT} * {line}" for line in wrapped[1:])]
    return [*inside[:-1], inside[-1] + " */"]


def _lookup_lines(layout: Layout, manifest: Manifest, lookup: Lookup, columns: slice) -> list[str]:
    if lookup.joint is None:
        numbers = layout.groups[lookup.number]
        names = [manifest.switches[number].name for number in numbers]
        heading = f"switches {numbers[0]} to {numbers[-1]}: " + ", ".join(map(comment, names))
        says = [_closed(names, byte) for byte in range(len(lookup.rows))]
    else:
        name = comment(manifest.joints[lookup.number].name)
        heading = f"joint {lookup.number}: {name}"
        steps = [str(step) for step in lookup.joint.thresholds.tolist()]
        says = [f"{name} to {step}" for step in steps] + [f"{name} above {steps[-1]}"]
    lines = ["", *remark(heading)]
    for row, what in zip(np.asarray(lookup.rows)[:, columns].tolist(), says, strict=True):
        lines += _row_lines(row, layout.entry_bits, what)
    return lines


def _closed(names: Sequence[str], byte: int) -> str:
    return " + ".join(comment(name) for bit, name in enumerate(names) if byte >> bit & 1) or "all open"


def _row_lines(row: Sequence[int], entry_bits: int, what: str) -> list[str]:
    """Return one row of the table; the comment goes behind it, or before it where it is too long for that."""
    at_once, macro = (2, "PAIR") if entry_bits == 16 else (4, "QUAD")
    digits = 6 if entry_bits == 16 else 3
    cells = []
    for at in range(0, len(row), at_once):
        held = row[at : at + at_once]
        name = macro if len(held) == at_once else "REST"
        cells.append(f"{name}(" + ", ".join(f"{number:{digits}d}" for number in held) + ")")
    half = 4
    joined = [", ".join(cells[at : at + half]) for at in range(0, len(cells), half)]
    text = _INDENT + "{" + f",\n{_INDENT} ".join(joined) + "},"
    lines = text.split("\n")
    ending = f" /* {what} */"
    if len(lines[-1]) + len(ending) <= COLUMNS:
        return [*lines[:-1], lines[-1] + ending]
    return [*remark(what), *lines]
