"""The classifier of a build as C99 for every target, and as assembly for an AVR."""

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from thenar.firmware_templates.rendering import render
from thenar.runtime.manifest import Rejection
from thenar.runtime.softmax import POWERS, Softmax

from .assembly import assembly_values, check_size
from .layout import MOST_INLINE, Field, JointLayout, Layout, Lookup, Parts
from .segments import segment_files
from .sensors import Sensors, codes_files, sensors_of
from .words import (
    Names,
    answers_of,
    comment,
    identifiers,
    inputs_in_words,
    joint_in_words,
    none_of,
    string,
    switches_in_words,
)

_STARTS_PER_LINE = 4
_HIGHEST = 65535  # the highest code

# Portable C adds several sums at once in a word of 32 bits: two of 16 bits, or four of 8. Two 16-bit entries are one
# integer, low + 65536 high, so words add up to the word of the sums, whatever was borrowed on the way; the same holds
# for four 8-bit entries that are summed in 8 bits. Where four 8-bit entries a, b, c, d are summed in 16, the even and
# the odd ones are added separately, each with 16 bits of room: none of their sums exceeds 65535, since it is the
# difference of two scores. The odd ones are not masked: (b, c, d) is 256 c more than b + 65536 d, and the sum of all
# c, the upper half of the even sum, is subtracted once at the end. Rows whose largest entries add up to at most 255, a
# batch, are added as they are before they are split.


def portable_values(name: str, layout: Layout) -> dict[str, object]:
    """Return the values for the templates of the portable C."""
    parts, biased, bits = layout.parts, layout.biased, layout.sum_bits
    lanes = _lanes(parts.width, biased, bits)
    n_lanes = max(lane for lane, _ in lanes) + 1
    slopes = [slope.row.astype(int) for slope in layout.tables.slopes]
    entries = 32 // layout.entry_bits
    return {
        "slopes": _slope_lines(slopes, parts, lanes),
        "distances": [_distance(layout, at) for at in range(len(slopes))],
        "words": -(-parts.width // entries),
        "lanes": n_lanes,
        "in_words": {2: "two", 4: "four"}[entries],
        "sum_bits": bits,
        "adding": _adding(layout),
        "passes": _passes(layout),
        "stores": [(lane, shift, k) for k, (lane, shift) in enumerate(lanes)],
        "held": [[k for k, (each, _) in enumerate(lanes) if each == lane] for lane in range(n_lanes)],
        "takes": [(lane, 32 - bits - shift, k) for k, (lane, shift) in enumerate(lanes)],
        "word_macros": _narrow_macros(parts.width) if biased else _sum_macros(parts.width, bits),
        "start": _start_lines(_in_parts(layout.start, parts), lanes, 32 // bits),
        "finds": [_find(name, layout, lookup) for lookup in layout.lookups],
        "batches": layout.batches,
        "entry_shift": layout.entry_shift,
    }


def _passes(layout: Layout) -> str:
    """Return the name of the template of classify() and update()."""
    return "one_part" if len(layout.parts.firsts) == 1 else "in_parts"


def _adding(layout: Layout) -> str:
    """Return the name of the template that adds up such entries."""
    if layout.biased:
        return "offsets"
    if layout.sum_bits == 8:
        return "quads"
    return "pairs" if len(layout.parts.firsts) == 1 else "pairs_in_parts"


def avr_macros(width: int, entry_bits: int) -> list[str]:
    """Return definitions of the same macros for a table of plain entries, one after the other."""
    at_once, macro = (4, "QUAD(a, b, c, d) (a), (b), (c), (d)") if entry_bits == 8 else (2, "PAIR(a, b) (a), (b)")
    rest = width % at_once
    whole = [macro] if width >= at_once else []
    return whole + [["", "REST(a) (a)", "REST(a, b) (a), (b)", "REST(a, b, c) (a), (b), (c)"][rest]][: bool(rest)]


def _lanes(width: int, biased: bool, bits: int) -> list[tuple[int, int]]:
    """Return for every class of a part the number of its word of sums, and the lowest bit of its sum in that word."""
    if biased:
        return [(2 * (k // 4) + k % 2, 16 if k % 4 >= 2 else 0) for k in range(width)]
    each = 32 // bits
    return [(k // each, bits * (k % each)) for k in range(width)]


def _sum_macros(width: int, bits: int) -> list[str]:
    """Return the macros of words that are sums of their entries, each shifted to its lane."""
    letters = "abcd"[: 32 // bits]
    cells = (f"(uint32_t)(int32_t)({letter})" + (f" << {bits * at}" if at else "") for at, letter in enumerate(letters))
    whole, more = ("QUAD", " \\\n    + ") if bits == 8 else ("PAIR", " + ")
    sums = more.join(f"({cell})" if "<<" in cell else cell for cell in cells)
    given, rest = ", ".join(letters), width % len(letters)
    macros = [f"{whole}({given}) ({sums})"]
    if rest:
        zeros = ", ".join([*letters[:rest], *["0"] * (len(letters) - rest)])
        macros.append(f"REST({', '.join(letters[:rest])}) {whole}({zeros})")
    return macros


def _narrow_macros(width: int) -> list[str]:
    quad = "QUAD(a, b, c, d) ((uint32_t)(a) | ((uint32_t)(b) << 8) | ((uint32_t)(c) << 16) | ((uint32_t)(d) << 24))"
    rests = ["REST(a) QUAD(a, 0, 0, 0)", "REST(a, b) QUAD(a, b, 0, 0)", "REST(a, b, c) QUAD(a, b, c, 0)"]
    return [quad] + ([rests[width % 4 - 1]] if width % 4 else [])


def _in_parts(scores: NDArray[np.int64], parts: Parts) -> list[list[int]]:
    return [scores[first : first + parts.width].tolist() for first in parts.firsts]


def _start_lines(starts: Sequence[Sequence[int]], lanes: Sequence[tuple[int, int]], room: int) -> list[str]:
    """Return the lines of the initialiser of the sums, in braces for each part, `room` sums to a word."""
    lines = []
    for start in starts:
        sums: dict[int, list[int]] = {}
        for (lane, _), value in zip(lanes, start, strict=True):
            sums.setdefault(lane, []).append(value)
        words = [f"START({', '.join(map(str, (sums[lane] + [0] * room)[:room]))})" for lane in sorted(sums)]
        held = [", ".join(words[at : at + _STARTS_PER_LINE]) for at in range(0, len(words), _STARTS_PER_LINE)]
        lines += ["{", *(f"    {line}," for line in held), "},"]
    return lines


def _find(name: str, layout: Layout, lookup: Lookup) -> list[str]:
    """Return the expression of the number of one lookup's row, in lines."""
    found = [f"{lookup.first_row}u"] if lookup.first_row else []
    if lookup.group is not None:
        fields = " | ".join(map(_field, layout.fields[lookup.group]))
        found.append(f"({fields})" if found else fields)
    for joint in lookup.joints:
        code = f"input->codes[{joint.number}]"
        if joint.compared:
            counted = f"not_below({joint.first_step}u, {len(joint.thresholds)}u, {code})"
            if len(joint.thresholds) <= MOST_INLINE:
                steps = joint.thresholds.tolist()
                # Plain sums of comparisons, stored in a byte, are miscompiled by GCC 12.
                counted = " + ".join(f"(({code} <= {step}u) ? 1u : 0u)" if step < _HIGHEST else "1u" for step in steps)
            found.append(f"({joint.weight}u * ({counted}))" if joint.weight > 1 else counted)
        else:
            place = f"clamped({code}, {joint.first}u, {len(joint.bins) - 1}u)"
            found.append(f"thenar_{name}_bins[{_after(joint.first_bin, place)}]")
    width = COLUMNS - 8 - len(f"found->rows[999] = thenar_{name}_rows[];")
    kept = " + ".join(found).replace(" ", "\xa0").replace("\xa0+\xa0", " +\xa0")
    lines = textwrap.wrap(kept, width, subsequent_indent=_INDENT, break_long_words=False)
    return [line.replace("\xa0", " ") for line in lines]


def _field(field: Field) -> str:
    """Return the expression of a field of a port's byte, shifted to its place in the group's byte."""
    by, mask = field.bit - field.to, ((1 << field.width) - 1) << field.to
    port = f"input->switches[{field.port}]"
    moved = f"((uint32_t){port} {'>>' if by > 0 else '<<'} {abs(by)})" if by else port
    return f"({moved} & 0x{mask:02X}u)"


def _slope_lines(rows: Sequence[NDArray[np.int64]], parts: Parts, lanes: Sequence[tuple[int, int]]) -> list[str]:
    """Return the rows of slopes as initialisers of words of two sums, in braces for each part."""
    lines = []
    for first in parts.firsts:
        words = (_lane_words(row[first : first + parts.width].tolist(), lanes) for row in rows)
        lines += [f"{_INDENT}{{", *(f"{2 * _INDENT}{{{row}}}," for row in words), f"{_INDENT}}},"]
    return lines


def _lane_words(row: list[int], lanes: Sequence[tuple[int, int]]) -> str:
    """Return the row of a slope, for the classes of a part, as words of two sums."""
    words: dict[int, list[int]] = {}
    for (lane, _), value in zip(lanes, row, strict=True):
        words.setdefault(lane, []).append(value)
    return ", ".join(f"SLOPE({words[lane][0]}, {(words[lane] + [0])[1]})" for lane in sorted(words))


def _distance(layout: Layout, at: int) -> str:
    """Return the expression for the distance of a slope's code."""
    slope = layout.tables.slopes[at]
    code = f"input->codes[{slope.joint}]"
    above = f"clamped({code}, {slope.low}u, {slope.high - slope.low}u)"
    shift = f" {'<<' if slope.gain > 0 else '>>'} {abs(slope.gain)}" if slope.gain else ""
    return f"(int16_t)(({above}{shift}) - {slope.zero})"


def _after(first: int, place: str) -> str:
    return f"{first}u + {place}" if first else place


LIBRARY_NAME = "glove"
"""The default name of the library: its files are thenar_glove.h and so on, its functions likewise."""
FIRMWARE_NAME = "firmware"
LIBRARY_FILES = tuple(
    f"thenar_{LIBRARY_NAME}{part}{ending}"
    for part in ("", "_tables", "_codes", "_segments")
    for ending in (".h", ".c", "_avr.S")
)
"""The folder of a build that contains the library, and the files that it may contain."""

COLUMNS = 120
_FOLDER = "classifier/"
_INDENT = "    "
_NUMBERS_PER_LINE = 16


def table_lines(layout: Layout, names: Names) -> list[str]:
    """Return the lines of the whole table: part after part, lookup after lookup."""
    lines = []
    for first in layout.parts.firsts:
        columns = slice(first, first + layout.parts.width)
        lines += remark("columns: " + ", ".join(map(comment, names.grasps[columns])))
        for lookup in layout.lookups:
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
    headings, says = [], [""]
    if lookup.group is not None:
        numbers = layout.groups[lookup.group]
        switches = [names.switches[number].name for number in numbers]
        headings.append(f"{switches_in_words(numbers)}: " + ", ".join(map(comment, switches)))
        says = [_closed(switches, byte) for byte in range(1 << len(numbers))]
    for joint in lookup.joints:
        name = comment(names.joints[joint.number].name)
        headings.append(f"joint {joint.number}: {name}")
        steps = joint.thresholds.tolist()[::-1]
        ranges = [f"{name} above {steps[0]}"] + [f"{name} to {step}" for step in steps]
        says = [f"{what}, {one}" if what else one for one in ranges for what in says]
    lines = ["", *remark("; ".join(headings))]
    for row, what in zip(np.asarray(lookup.rows)[:, columns].tolist(), says, strict=True):
        lines += _row_lines(row, layout.entry_bits, what)
    return lines


def _closed(names: Sequence[str], byte: int) -> str:
    return " + ".join(comment(name) for bit, name in enumerate(names) if byte >> bit & 1) or "all open"


def _row_lines(row: Sequence[int], entry_bits: int, what: str) -> list[str]:
    """Return one row of the table; the comment follows it, or precedes it if it is too long."""
    at_once, macro = (2, "PAIR") if entry_bits == 16 else (4, "QUAD")
    digits = 6 if entry_bits == 16 else 4
    cells = []
    for at in range(0, len(row), at_once):
        held = row[at : at + at_once]
        name = macro if len(held) == at_once else "REST"
        cells.append(f"{name}(" + ", ".join(f"{number:{digits}d}" for number in held) + ")")
    most = 4 if sum(len(cell) + 2 for cell in cells[:4]) + len(_INDENT) < COLUMNS else 3
    joined = [", ".join(cells[at : at + most]) for at in range(0, len(cells), most)]
    text = _INDENT + "{" + f",\n{_INDENT} ".join(joined) + "},"
    lines = text.split("\n")
    ending = f" /* {what} */"
    if len(lines[-1]) + len(ending) <= COLUMNS:
        return [*lines[:-1], lines[-1] + ending]
    return [*remark(what), *lines]


@dataclass(frozen=True)
class Library:
    """The classifier for a target's files: its name, the names in it, and its layout.

    name   of its files and functions, thenar_NAME: one that words.check_name allows
    avr    whether it adds rows in an AVR's assembly there
    notes  lines for the opening comments
    glove  the known sensors of a glove; None: only the names are known
    """

    name: str
    names: Names
    layout: Layout
    avr: bool
    notes: tuple[str, ...] = ()
    glove: Sensors | None = None

    @property
    def sensors(self) -> Sensors:
        """The sensors whose readings become codes."""
        return sensors_of(self.names) if self.glove is None else self.glove

    @cached_property
    def files(self) -> dict[str, str]:
        """The classifier's own files, name -> text."""
        return classifier_files(self.name, self.names, self.layout, avr=self.avr, notes=self.notes)

    @cached_property
    def whole(self) -> dict[str, str]:
        """The classifier's files, those that convert readings to codes, and the decoder of segments where the build has
        segment costs.
        """
        return self.files | self.codes | self.segments

    @cached_property
    def codes(self) -> dict[str, str]:
        """The files that convert readings to codes."""
        return codes_files(self.name, self.sensors, code_bits=self.layout.code_bits, avr=self.avr)

    @cached_property
    def segments(self) -> dict[str, str]:
        """The files of the decoder of segments."""
        model = self.names.segments
        return {} if model is None else segment_files(self.name, model, avr=self.avr)

    @property
    def objects(self) -> str:
        """The object files of its sources, for a Makefile."""
        return " ".join(path.rsplit(".", 1)[0] + ".o" for path in self.whole if path.endswith((".c", ".S")))


def classifier_files(
    name: str, names: Names, layout: Layout, *, avr: bool, notes: Sequence[str] = ()
) -> dict[str, str]:
    """Return the texts of thenar_`name`.h and .c, and with `avr` of thenar_`name`_avr.S.

    `name` is one that words.check_name allows; `names` are those of the inputs and types of the tables in `layout`.
    With `avr` the .c is for AVRs, where the .S adds, and for all others; without it, for all but AVRs. `notes` are
    lines for the opening comments. Raises FirmwareError if the tables exceed what an AVR can read.
    """
    if avr:
        check_size(layout)
    portable, found = portable_values(name, layout), _source_values(names, layout)
    values = _common_values(name, names, layout, avr) | portable | found | _header_values(name, names, layout)
    if avr:
        values |= {"assembly": assembly_values(name, names, layout)}
    endings = (".h", ".c", "_tables.h", "_tables.c", "_avr.S")[: 4 + avr]
    return {
        f"thenar_{name}{ending}": render(
            f"{_FOLDER}thenar_NAME{ending}.j2", **values, opening=_opening(name, names, ending, notes)
        )
        for ending in endings
    }


def _opening(name: str, names: Names, ending: str, notes: Sequence[str]) -> str:
    """Return the comment that every file begins with."""
    what = {
        ".h": f"Recognises {len(names.grasps)} grasp types from "
        f"{inputs_in_words(len(names.switches), len(names.joints))} of a glove.",
        ".c": "integer arithmetic; the header describes its use.",
        "_tables.h": "definitions of the tables for the library's own files; programs do not need it.",
        "_tables.c": "the tables.",
        "_avr.S": "the addition of rows, on an AVR.",
    }[ending]
    made = (
        f"From the tables {names.tables_sha256[:16]}; thenar {version('thenar')}, "
        f"template {_FOLDER}thenar_NAME{ending}.j2."
    )
    if ending != ".h":
        return f"/* thenar_{name}{ending}: {what}\n\n   {made} */"
    lines = [f"@file thenar_{name}.h", f"@brief {what}", "", *map(comment, notes), "", made]
    return "/**\n" + "\n".join(f" * {line}".rstrip() for line in lines) + "\n */"


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
        "biased": layout.biased,
        "entry_type": layout.lookups[0].rows.dtype.name + "_t" if layout.lookups else "int16_t",
        "parts": len(layout.parts.firsts),
        "width": layout.parts.width,
        "n_rows": layout.n_rows,
        "n_lookups": len(layout.lookups),
        "n_slopes": len(layout.tables.slopes),
        "relative": layout.tables.relative,
        "nothing_held": none_of(names),
        "rejection": names.rejection,
    }


def _unsigned(most: int) -> str:
    """Return the C type for 0..most; most itself means "none"."""
    return "uint8_t" if most <= 255 else "uint16_t"


def _source_values(names: Names, layout: Layout) -> dict[str, object]:
    searched = [joint for joint in layout.joints if joint.compared and len(joint.thresholds) > MOST_INLINE]
    trimmed = [joint for joint in layout.joints if not joint.compared]
    steps = [step for joint in searched for step in joint.thresholds.tolist()]
    means = layout.means
    return {
        "table": table_lines(layout, names),
        "bins": [line for joint in trimmed for line in _bin_lines(names, joint)],
        "n_bins": sum(len(joint.bins) for joint in trimmed),
        "clamped": bool(trimmed) or bool(layout.tables.slopes),
        "thresholds": number_lines(steps),
        "n_thresholds": len(steps),
        "means": _mean_lines(means),
        "mean_type": "int8_t" if layout.narrow_means else "int16_t",
        "n_inputs": len(means),
        "starts": number_lines(layout.start.tolist()),
        "powers": number_lines(POWERS),
        "softmax": Softmax(layout.tables.scale),
        "names": [string(grasp) for grasp in answers_of(names)],
        "longest_name": max(len(grasp.encode()) for grasp in answers_of(names)) + 1,
        "places": _place_lines(layout),
        "port_type": _unsigned(len(layout.ports)),
        "first_classes": number_lines(layout.parts.firsts),
        "avr_macros": avr_macros(layout.parts.width, layout.entry_bits),
        **({} if names.rejection is None else _rejection_lines(names.rejection)),
    }


def _rejection_lines(rejection: Rejection) -> dict[str, list[str]]:
    ranges = ["{" + ", ".join(f"{{{low}u, {high}u}}" for low, high in own) + "}," for own in rejection.ranges]
    wrapped = (
        textwrap.wrap(line, COLUMNS - 8, initial_indent=_INDENT, subsequent_indent=2 * _INDENT) for line in ranges
    )
    return {
        "least_scores": number_lines(rejection.least_scores),
        "closed": [f"{_INDENT}{{{low}u, {high}u}}," for low, high in rejection.closed],
        "ranges": [line for own in wrapped for line in own],
    }


def _bin_lines(names: Names, joint: JointLayout) -> list[str]:
    """Return the contributions of a joint's codes to the number of a row, as lines, after a comment with its name."""
    name = names.joints[joint.number].name
    return [*remark(comment(f"{name}, from code {joint.first} on")), *number_lines(joint.bins.tolist())]


def _mean_lines(means: NDArray[np.int64]) -> list[str]:
    """Return a row of the means in braces for each input, as words of 16 bits."""
    lines = []
    for row in means.astype(np.int16).tolist():
        first, *more = number_lines(row)
        held = [f"{_INDENT}{{{first.lstrip()}", *more]
        lines += [*held[:-1], f"{held[-1].removesuffix(',')}}},"]
    return lines


def _place_lines(layout: Layout) -> list[str]:
    """Return for each switch its port number and its bit, eight on a line."""
    pairs = [f"{{{port}, {1 << bit}}}," for port, bit in layout.places]
    return [_INDENT + " ".join(pairs[at : at + 8]) for at in range(0, len(pairs), 8)]


def _header_values(name: str, names: Names, layout: Layout) -> dict[str, list[str]]:
    """Return the lines of the enumerations in the header."""
    kinds = {
        "grasp": [(grasp, comment(grasp)) for grasp in names.grasps],
        "switch": [
            (switch.name, comment(f"{switch.name}: switches[{port}], 0x{1 << bit:02X}"))
            for switch, (port, bit) in zip(names.switches, layout.places, strict=True)
        ],
        "joint": [(joint.name, comment(joint_in_words(joint))) for joint in names.joints],
    }
    return {f"{kind}_enum": _enumerators(f"THENAR_{name}_{kind}".upper(), each) for kind, each in kinds.items()}


def _enumerators(prefix: str, named: Sequence[tuple[str, str]]) -> list[str]:
    """Return the lines of enumerators, each with its description; the description comes first if it is too long."""
    lines = []
    for number, (word, (_, what)) in enumerate(zip(identifiers([own for own, _ in named]), named, strict=True)):
        line, more = f"{prefix}_{word} = {number},", f" /**< {what} */"
        if len(_INDENT + line + more) <= COLUMNS:
            lines.append(line + more)
        else:
            first, *rest = textwrap.wrap(what, COLUMNS - 14, break_long_words=True, break_on_hyphens=False)
            lines += [f"/** {first}", *(f" *  {each}" for each in rest)]
            lines[-1] += " */"
            lines.append(line)
    return lines
