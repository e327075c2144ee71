"""What a classifier costs: in portable C, which adds words of two sums, by a model that is rough but not too low.

The model is fitted to what qemu counts of code by arm-none-eabi-gcc 12 with -O2, for 3 to 28 classes and 4 to 23
look-ups: 0 to 22 % above on an M0+, 0 to 17 % on an M4. Entries of 8 bits take longer there than those of 16 bits, for
they must be taken apart before they are added: 8 bits are for flash. Other compilers and cores differ.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from .layout import Layout

Unit = Literal["cycles", "instructions", ""]

NAME_BYTES = 16  # all names take as much room as the longest, and there is one more, which is empty


@dataclass(frozen=True, slots=True)
class Cost:
    """What a classifier takes at most.

    cycles          that classify() takes for any frame; elsewhere than on an AVR instructions
    update_cycles   that update() takes, whatever has changed
    flash           bytes of all of it, with names of grasp types of up to 15 bytes
    flash_classify  of these, bytes that a program has which never calls update() and never says that an input is
                    missing, where the linker leaves out what is not called (--gc-sections; C compiled with
                    -ffunction-sections -fdata-sections)
    ram             bytes, stack included, whichever of the two is called
    """

    cycles: int
    update_cycles: int
    flash: int
    flash_classify: int
    ram: int


@dataclass(frozen=True, slots=True)
class Core:
    """Instructions of a class, and how many more where classes are added up in parts; of a look-up; in each part of a
    look-up, of a word of two 16-bit entries, and of a word of four 8-bit entries; in update() of a word of two or of
    four that is replaced.
    """

    a_class: int
    in_parts: int
    lookup: int
    part: int
    pair: int
    quad: int
    replaced_pair: int
    replaced_quad: int


CORTEX_M4 = Core(a_class=11, in_parts=2, lookup=5, part=3, pair=2, quad=5, replaced_pair=5, replaced_quad=16)
"""What other cores of 32 bits are taken to be like."""


_REPLACING = 17  # a row in update(), but for its words
# More than for a code that is looked up directly: a byte clamped below and above, where it can lie there; a code of 16
# bits clamped; a code searched, and each step of the search.
_BELOW, _ABOVE, _WIDE = 4, 6, 13
_SEARCHED, _SEARCH_STEP = 6, 14

# Of code; where classes are added up in parts, that takes more.
_BYTES, _BYTES_PARTS, _BYTES_LOOKUP, _BYTES_CLASS, _BYTES_PAIR, _BYTES_QUAD = 150, 250, 21, 13, 55, 111
_BYTES_UPDATE, _BYTES_UPDATE_PAIR, _BYTES_UPDATE_QUAD = 185, 9, 46
_BYTES_CLAMPED, _BYTES_SEARCHED = 26, 52
# Of what replaces missing inputs, beside the table of their means.
_BYTES_LOSING, _FIELD, _MISSING = 290, 3, 3
_STACK = 128


def word_cost(layout: "Layout", core: Core) -> Cost:
    """Return what the portable C takes on a core, roughly."""
    rows, classes, wide = len(layout.parts.firsts), layout.tables.n_classes, layout.entry_bits == 16
    words, finding = _words(layout), _finding(layout)
    adding = rows * (core.part + words * (core.pair if wide else core.quad))
    replacing = _REPLACING + rows * words * (core.replaced_pair if wide else core.replaced_quad)
    answering = (core.a_class + (core.in_parts if rows > 1 else 0)) * classes + finding
    classify, update = (layout.n_lookups * (core.lookup + each) + answering for each in (adding, replacing))
    flash = _flash(layout) + NAME_BYTES * (classes + 1)
    update_flash = _BYTES_UPDATE + words * (_BYTES_UPDATE_PAIR if wide else _BYTES_UPDATE_QUAD)
    losing = _BYTES_LOSING + layout.means.size * (1 if layout.narrow_means else 2)
    return Cost(classify, update, flash + update_flash + losing, flash, _ram(layout))


def _words(layout: "Layout") -> int:
    """Return how many words a row has."""
    return -(-layout.parts.width * layout.entry_bits // 32)


def _finding(layout: "Layout") -> int:
    """Return the instructions that finding rows takes beyond those of a direct look-up of whole bytes."""
    return _MISSING + _FIELD * sum(map(len, layout.fields)) + _finding_joints(layout)


def _finding_joints(layout: "Layout") -> int:
    joints = [joint for joint in layout.joints if not joint.constant]
    match layout.bins:
        case "direct":
            return 0
        case "trimmed":
            if layout.code_bits == 16:
                return _WIDE * len(joints)
            above = sum(joint.first + len(joint.bins) <= 255 for joint in joints)
            return _BELOW * sum(joint.first > 0 for joint in joints) + _ABOVE * above
        case "search":
            return sum(_SEARCHED + _SEARCH_STEP * len(joint.thresholds).bit_length() for joint in joints)


def _flash(layout: "Layout") -> int:
    """Return the bytes of tables and code, update() left out, at most, roughly; the names of the grasp types come on
    top.
    """
    parts, words = layout.parts, _words(layout)
    joints = [joint for joint in layout.joints if not joint.constant]
    found = sum(len(joint.bins) for joint in joints)
    finding = {"direct": 0, "trimmed": _BYTES_CLAMPED, "search": _BYTES_SEARCHED}[layout.bins]
    if layout.bins == "search":
        found = sum(len(joint.thresholds) for joint in joints) * layout.code_bits // 8
    rows = 4 * layout.n_rows * words * len(parts.firsts)
    places = layout.tables.n_switches * (2 if len(layout.ports) <= 255 else 4)
    starts = 2 * len(parts.firsts) * (2 * parts.width + 8)  # of the sums, constant and as they are in the beginning
    starts += 2 * layout.tables.n_classes + 4 * layout.n_lookups  # scores, and rows added, in the beginning
    code = _BYTES + (_BYTES_PARTS if len(parts.firsts) > 1 else 0) + _BYTES_CLASS * parts.width
    code += _BYTES_LOOKUP * layout.n_lookups + words * (_BYTES_PAIR if layout.entry_bits == 16 else _BYTES_QUAD)
    return rows + found + places + starts + code + finding * len(joints)


def _ram(layout: "Layout") -> int:
    """Return the bytes of variables and stack, roughly."""
    classes = layout.tables.n_classes
    frame = len(layout.ports) + layout.padding + layout.tables.n_joints * layout.code_bits // 8
    lost = len(layout.ports) + -(-layout.tables.n_joints // 8) + 4
    rows = 2 * 4 * layout.n_lookups  # pointers to those added, and in update() to those that are now
    return frame + 2 * classes + 4 * (classes + 6) + lost + rows + _STACK
