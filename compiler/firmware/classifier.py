"""The classifier of a build as C99 for every target, and as assembly for an AVR."""

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from thenar.firmware_templates.rendering import render
from thenar.runtime.manifest import Calibration

from .assembly import assembly_values, check_size
from .layout import NO_SWITCH, Field, Layout, Lookup, Parts, lookups
from .words import Names, comment, inputs_in_words, string, switches_in_words

_STARTS_PER_LINE = 4

# Portable C adds two sums of 16 bits side by side in a word of 32. Two 16-bit entries are one integer, low + 65536
# high, so words add up to the word of the sums, whatever was borrowed on the way. Of four 8-bit entries a, b, c, d
# the even and the odd ones are added up apart, each with 16 bits of room: no sum of them is above 65535, for it is
# the difference of two scores. The odd ones are not masked: (b, c, d) is 256 c more than b + 65536 d, and the sum of
# all c, the upper half of the even sum, is subtracted once, in the end.


def portable_values(name: str, layout: Layout) -> dict[str, object]:
    """Return what the templates of the portable C ask for."""
    narrow, parts = layout.entry_bits == 8, layout.parts
    lanes = _lanes(parts.width, narrow)
    starts, open_sums = (_start_lines(_in_parts(scores, parts), lanes) for scores in (layout.start, layout.all_open))
    n_lanes = max(lane for lane, _ in lanes) + 1
    adding, replacing = _arithmetic(n_lanes, narrow)
    return {
        "words": -(-parts.width // (4 if narrow else 2)),
        "lanes": n_lanes,
        "takes": _takes(lanes, len(parts.firsts) > 1),
        "word_macros": _narrow_macros(parts.width) if narrow else _wide_macros(parts.width),
        "start": starts,
        "open_sums": open_sums,
        "open_rows": [f"&thenar_{name}_rows[{lookup.first_row}]," for lookup in lookups(layout)],
        "finds": [line for lookup in lookups(layout) for line in _find(name, layout, lookup)],
        "n_lookups": layout.n_lookups,
        "adding": adding,
        "storing": _storing(n_lanes, narrow),
        "replacing": replacing,
    }


def avr_macros(width: int, entry_bits: int) -> list[str]:
    """Return definitions of the same macros for a table of plain entries, one after the other."""
    at_once, macro = (4, "QUAD(a, b, c, d) (a), (b), (c), (d)") if entry_bits == 8 else (2, "PAIR(a, b) (a), (b)")
    rest = width % at_once
    whole = [macro] if width >= at_once else []
    return whole + [["", "REST(a) (a)", "REST(a, b) (a), (b)", "REST(a, b, c) (a), (b), (c)"][rest]][: bool(rest)]


def _lanes(width: int, narrow: bool) -> list[tuple[int, str]]:
    """Return for every class of a part the number of its word of sums, and which half of it is its sum."""
    if narrow:
        return [(2 * (k // 4) + k % 2, "high" if k % 4 >= 2 else "low") for k in range(width)]
    return [(k // 2, "high" if k % 2 else "low") for k in range(width)]


def _wide_macros(width: int) -> list[str]:
    pair = "PAIR(a, b) ((uint32_t)(int32_t)(a) + ((uint32_t)(int32_t)(b) << 16))"
    return [pair] + (["REST(a) PAIR(a, 0)"] if width % 2 else [])


def _narrow_macros(width: int) -> list[str]:
    quad = "QUAD(a, b, c, d) ((uint32_t)(a) | ((uint32_t)(b) << 8) | ((uint32_t)(c) << 16) | ((uint32_t)(d) << 24))"
    rests = ["REST(a) QUAD(a, 0, 0, 0)", "REST(a, b) QUAD(a, b, 0, 0)", "REST(a, b, c) QUAD(a, b, c, 0)"]
    return [quad, "EVEN(word) ((word) & 0x00FF00FFu)", "ODD(word) (((word) >> 8) & 0x00FF00FFu)"] + (
        [rests[width % 4 - 1]] if width % 4 else []
    )


def _in_parts(scores: NDArray[np.int64], parts: Parts) -> list[list[int]]:
    return [scores[first : first + parts.width].tolist() for first in parts.firsts]


def _start_lines(starts: Sequence[Sequence[int]], lanes: Sequence[tuple[int, str]]) -> list[str]:
    """Return the lines of the initialiser of the sums, in braces for each part where there are several."""
    lines = []
    for start in starts:
        sums: dict[int, list[int]] = {}
        for (lane, _), value in zip(lanes, start, strict=True):
            sums.setdefault(lane, []).append(value)
        words = [f"START({', '.join(map(str, (sums[lane] + [0])[:2]))})" for lane in sorted(sums)]
        held = [", ".join(words[at : at + _STARTS_PER_LINE]) for at in range(0, len(words), _STARTS_PER_LINE)]
        text = [f"{line}," for line in held]
        lines += text if len(starts) == 1 else ["{", *(f"    {line}" for line in text), "},"]
    return lines


def _takes(lanes: Sequence[tuple[int, str]], several: bool) -> list[str]:
    """Return the arguments that say the sum and the number of each class of a part."""
    words, halves = "sum" if several else "sums", {"low": "& 0xFFFFu", "high": ">> 16"}
    numbers = (f"first + {k}u" if several and k else "first" if several else f"{k}u" for k in range(len(lanes)))
    return [f"{words}[{lane}] {halves[half]}, {k}" for (lane, half), k in zip(lanes, numbers, strict=True)]


def _arithmetic(lanes: int, narrow: bool) -> tuple[list[str], list[str]]:
    """Return the statements that add a row to the sums s0, s1..., and those that replace one in sum[]."""
    adding, replacing = [], []
    for lane in range(lanes):
        row, before, after = (f"{each}[{lane // 2 if narrow else lane}]" for each in ("row", "before", "after"))
        if narrow:
            macro = "ODD" if lane % 2 else "EVEN"
            row = f"{row} >> 8" if lane % 2 else f"EVEN({row})"
            before, after = f"{macro}({before})", f"{macro}({after})"
        adding.append(f"s{lane} += {row};")
        replacing.append(f"sum[{lane}] += {after} - {before};")
    return adding, replacing


def _storing(lanes: int, narrow: bool) -> list[str]:
    """Return the statements that put the sums s0, s1..., in words of two, into sum[]."""
    if not narrow:
        return [f"sum[{lane}] = s{lane};" for lane in range(lanes)]
    sums = (f"s{lane} - ((s{lane - 1} >> 16) << 8)" if lane % 2 else f"s{lane}" for lane in range(lanes))
    return [f"sum[{lane}] = from[{lane}] + {text};" for lane, text in enumerate(sums)]


def _find(name: str, layout: Layout, lookup: Lookup) -> list[str]:
    """Return the lines of the statement that finds the row of one look-up."""
    if lookup.joint is None:
        found = " | ".join(map(_field, layout.fields[lookup.number]))
        found = f"({found})" if len(layout.fields[lookup.number]) > 1 and lookup.first_row else found
    else:
        code, joint = f"thenar_{name}_input.codes[{lookup.number}]", lookup.joint
        if layout.bins == "search":
            found = f"below({lookup.first_bin}u, {len(joint.thresholds)}u, {code})"
        else:
            last = len(joint.bins) - 1
            place = code if layout.bins == "direct" else f"clamped({code}, {joint.first}u, {last}u)"
            found = f"thenar_{name}_bins[{_after(lookup.first_bin, place)}]"
    statement = f"row[{lookup.index}] = &thenar_{name}_rows[{_after(lookup.first_row, found)}];"
    return textwrap.wrap(statement, COLUMNS - 4, subsequent_indent=_INDENT)


def _field(field: Field) -> str:
    """Return the expression of a field of a port's byte, at its place in the group's."""
    by, mask = field.bit - field.to, ((1 << field.width) - 1) << field.to
    moved = f"((uint32_t)ports[{field.port}] {'>>' if by > 0 else '<<'} {abs(by)})" if by else f"ports[{field.port}]"
    return f"({moved} & 0x{mask:02X}u)"


def _after(first: int, place: str) -> str:
    return f"{first}u + {place}" if first else place


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
        heading = f"{switches_in_words(numbers)}: " + ", ".join(map(comment, switches))
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
        ".h": {"ports": _port_notes(names, layout), "joints": _joint_notes(names)},
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
        "n_ports": len(layout.ports),
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
    means = layout.means
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
        "means": _mean_lines(means),
        "mean_type": "int8_t" if layout.narrow_means else "int16_t",
        "n_inputs": len(means),
        "starts": number_lines(layout.start.tolist()),
        "open_scores": number_lines(layout.all_open.tolist()),
        "names": [string(grasp) for grasp in names.grasps],
        "longest_name": max(len(grasp.encode()) for grasp in names.grasps) + 1,
        "places": _place_lines(layout),
        "port_type": _unsigned(len(layout.ports)),
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


def _mean_lines(means: NDArray[np.int64]) -> list[str]:
    """Return a row of the means in braces for each input, as words of 16 bits."""
    lines = []
    for row in means.astype(np.int16).tolist():
        first, *more = number_lines(row)
        held = [f"{_INDENT}{{{first.lstrip()}", *more]
        lines += [*held[:-1], f"{held[-1].removesuffix(',')}}},"]
    return lines


def _place_lines(layout: Layout) -> list[str]:
    """Return for each switch the number of its port and the bit, eight on a line."""
    pairs = [f"{{{port}, {1 << bit}}}," for port, bit in layout.places]
    return [_INDENT + " ".join(pairs[at : at + 8]) for at in range(0, len(pairs), 8)]


def _port_notes(names: Names, layout: Layout) -> list[str]:
    shown = (("-" if n == NO_SWITCH else comment(names.switches[n].name) for n in port) for port in layout.ports)
    wrapped = (textwrap.wrap(", ".join(port), COLUMNS - 20, break_on_hyphens=False) for port in shown)
    return [f"\n{' ' * 18}".join(lines) for lines in wrapped]


def _joint_notes(names: Names) -> list[str]:
    return [comment(f"{joint.name}, {_scale(joint)}") for joint in names.joints]


def _scale(joint: Calibration) -> str:
    if joint.unit == "raw":
        return "the glove's own codes"
    return f"code {joint.code_a} = {joint.value_a:g} {joint.unit}, {joint.code_b} = {joint.value_b:g} {joint.unit}"
