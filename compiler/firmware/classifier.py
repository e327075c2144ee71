"""The classifier of a build as C99 for every target, and as assembly for an AVR."""

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version

import numpy as np

from thenar.firmware_templates.rendering import render
from thenar.runtime.manifest import Calibration

from .assembly import assembly_values, check_size
from .layout import Layout, Lookup, lookups
from .portable import avr_macros, portable_values
from .words import Names, comment, inputs_in_words, string

LIBRARY_NAME = "glove"
"""What the library is called unless it is named: its files are thenar_glove.h and so on, its functions alike."""
FIRMWARE_NAME = "firmware"
LIBRARY_FILES = tuple(f"thenar_{LIBRARY_NAME}{ending}" for ending in (".h", ".c", "_avr.S"))
"""The folder of a build that carries the library, and what it may hold."""

COLUMNS = 120
_FOLDER = "classifier/"
_INDENT = "    "
_NUMBERS_PER_LINE = 16


def table_lines(layout: Layout, names: Names) -> list[str]:
    """Return the lines of the whole table: part after part, look-up after look-up."""
    lines = []
    for first in layout.parts.firsts:
        columns = slice(first, first + layout.parts.width)
        lines += remark("columns: " + ", ".join(map(comment, names.grasps[columns])))
        for lookup in lookups(layout):
            lines += _lookup_lines(layout, names, lookup, columns)
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


def _lookup_lines(layout: Layout, names: Names, lookup: Lookup, columns: slice) -> list[str]:
    if lookup.joint is None:
        numbers = layout.groups[lookup.number]
        switches = [names.switches[number].name for number in numbers]
        heading = f"switches {numbers[0]} to {numbers[-1]}: " + ", ".join(map(comment, switches))
        says = [_closed(switches, byte) for byte in range(len(lookup.rows))]
    else:
        name = comment(names.joints[lookup.number].name)
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


@dataclass(frozen=True)
class Library:
    """The classifier that a target's files are made around: what it is called, what it is of, how it is laid out.

    name   of its files and functions, thenar_NAME: one that words.check_name allows
    avr    whether it adds up in an AVR's assembly there
    notes  lines for the opening comments
    """

    name: str
    names: Names
    layout: Layout
    avr: bool
    notes: tuple[str, ...] = ()

    @cached_property
    def files(self) -> dict[str, str]:
        """The classifier's own files, name -> text."""
        return classifier_files(self.name, self.names, self.layout, avr=self.avr, notes=self.notes)


def classifier_files(
    name: str, names: Names, layout: Layout, *, avr: bool, notes: Sequence[str] = ()
) -> dict[str, str]:
    """Return the texts of thenar_`name`.h and .c, and with `avr` of thenar_`name`_avr.S.

    `name` is one that words.check_name allows, `names` are of the inputs and types of the tables in `layout`. With
    `avr` the .c serves AVRs, where the .S adds, and all others; without it, all but AVRs. `notes` are lines for the
    opening comments. Raises FirmwareError if the tables are beyond what an AVR can read.
    """
    if avr:
        check_size(layout)
    common = _common_values(name, names, layout, avr)
    texts: dict[str, dict[str, object]] = {
        ".h": {"groups": _group_notes(names, layout), "joints": _joint_notes(names)},
        ".c": _source_values(names, layout) | portable_values(name, layout),
    }
    if avr:
        texts["_avr.S"] = assembly_values(name, names, layout)
    return {
        f"thenar_{name}{ending}": render(
            f"{_FOLDER}thenar_NAME{ending}.j2", **common, **values, opening=_opening(name, names, ending, notes)
        )
        for ending, values in texts.items()
    }


def _opening(name: str, names: Names, ending: str, notes: Sequence[str]) -> str:
    """Return the comment that every file begins with."""
    what = {
        ".h": f"recognises {len(names.grasps)} grasp types from "
        f"{inputs_in_words(len(names.switches), len(names.joints))} of a glove",
        ".c": "tables and integer arithmetic; the header says how it is used",
        "_avr.S": "the adding up, on an AVR; the .c holds the tables",
    }[ending]
    lines = [
        f"thenar_{name}{ending}: {what}.",
        *map(comment, notes),
        "",
        f"From the tables {names.tables_sha256[:16]}; thenar {version('thenar')}, "
        f"template {_FOLDER}thenar_NAME{ending}.j2.",
    ]
    return "/* " + "\n".join(f"   {line}".rstrip() for line in lines).lstrip() + " */"


def _common_values(name: str, names: Names, layout: Layout, avr: bool) -> dict[str, object]:
    n_classes, n_switches, n_joints = len(names.grasps), len(names.switches), len(names.joints)
    return {
        "name": name,
        "upper": name.upper(),
        "avr": avr,
        "classes": n_classes,
        "switches": n_switches,
        "n_groups": len(layout.groups),
        "n_joints": n_joints,
        "class_type": _unsigned(n_classes),
        "switch_type": _unsigned(n_switches),
        "code_type": f"uint{layout.code_bits}_t",
        "padding": layout.padding,
        "narrow": layout.entry_bits == 8,
        "parts": len(layout.parts.firsts),
        "width": layout.parts.width,
        "n_rows": layout.n_rows,
    }


def _unsigned(most: int) -> str:
    """Return the type of numbers up to `most` itself, which says "none"."""
    return "uint8_t" if most <= 255 else "uint16_t"


def _source_values(names: Names, layout: Layout) -> dict[str, object]:
    joints = [lookup for lookup in lookups(layout) if lookup.joint is not None]
    searched = layout.bins == "search" and bool(joints)
    bins = sum(len(_bins(lookup)) for lookup in joints)
    steps = [step for lookup in joints for step in _steps(lookup)] if searched else []
    return {
        "table": table_lines(layout, names),
        "bins": [line for lookup in joints if bins for line in _bin_lines(names, lookup)],
        "n_bins": bins,
        "paged": layout.bins == "direct" and bool(joints),
        "clamped": layout.bins == "trimmed" and bool(joints),
        "searched": searched,
        "thresholds": number_lines(steps),
        "n_thresholds": len(steps),
        "found": joints if searched else [],
        "n_found": len(joints),
        "open_scores": number_lines(layout.all_open.tolist()),
        "names": [string(grasp) for grasp in names.grasps],
        "longest_name": max(len(grasp.encode()) for grasp in names.grasps) + 1,
        "places": _place_lines(layout),
        "group_type": _unsigned(len(layout.groups)),
        "first_classes": number_lines(layout.parts.firsts),
        "avr_macros": avr_macros(layout.parts.width, layout.entry_bits),
    }


def _bins(lookup: Lookup) -> list[int]:
    return [] if lookup.joint is None else lookup.joint.bins.tolist()


def _bin_lines(names: Names, lookup: Lookup) -> list[str]:
    """Return the rows of a joint's codes as lines, and before them whose they are."""
    first = 0 if lookup.joint is None else lookup.joint.first
    name = names.joints[lookup.number].name
    return [*remark(comment(f"{name}, from code {first} on")), *number_lines(_bins(lookup))]


def _steps(lookup: Lookup) -> list[int]:
    return [] if lookup.joint is None else lookup.joint.thresholds.tolist()


def _place_lines(layout: Layout) -> list[str]:
    """Return a line per group: for each of its switches the number of the group and the bit."""
    return [
        "    " + " ".join(f"{{{g}, {1 << bit}}}," for bit in range(len(numbers)))
        for g, numbers in enumerate(layout.groups)
    ]


def _group_notes(names: Names, layout: Layout) -> list[str]:
    return [", ".join(comment(names.switches[number].name) for number in numbers) for numbers in layout.groups]


def _joint_notes(names: Names) -> list[str]:
    return [comment(f"{joint.name}, {_scale(joint)}") for joint in names.joints]


def _scale(joint: Calibration) -> str:
    if joint.unit == "raw":
        return "the glove's own codes"
    return f"code {joint.code_a} = {joint.value_a:g} {joint.unit}, {joint.code_b} = {joint.value_b:g} {joint.unit}"
