"""Instructions, flash and RAM of the classifier in portable C, which adds words of two sums: rough, but not too low.

Fitted to what qemu counts of code by arm-none-eabi-gcc 12 with -O2, for 3 to 28 classes and 4 to 23 look-ups: 0 to 22 %
above on an M0+, 0 to 17 % on an M4. Entries of 8 bits take longer there than those of 16 bits, for they must be taken
apart before they are added: 8 bits are for flash. Other compilers and cores differ.
"""

from dataclasses import dataclass

from .layout import Layout
from .parts import parts_of
from .targets import Target


@dataclass(frozen=True, slots=True)
class _Core:
    """Instructions of a class, and how many more where classes are added up in parts; of a look-up; in each part of a
    look-up, of a word of two 16-bit entries, and of a word of four 8-bit entries.
    """

    a_class: int
    in_parts: int
    lookup: int
    part: int
    pair: int
    quad: int


_CORES = {"cortex-m0plus": _Core(13, 10, 10, 0, 3, 11)}
_OTHERS = _Core(11, 2, 5, 3, 2, 5)
# Replacing a row in update(), and each of its words of two or of four entries.
_REPLACING, _REPLACED, _REPLACED_OTHERS = 17, {"cortex-m0plus": (7, 20)}, (5, 16)
# More than for a code that is looked up directly: a byte clamped below and above, where it can lie there; a code of 16
# bits clamped; a code searched, and each step of the search.
_BELOW, _ABOVE, _WIDE = 4, 6, 13
_SEARCHED, _SEARCH_STEP = 6, 14

# Of code; where classes are added up in parts, that takes more.
_BYTES, _BYTES_PARTS, _BYTES_LOOKUP, _BYTES_CLASS, _BYTES_PAIR, _BYTES_QUAD = 60, 250, 21, 13, 55, 111
_BYTES_UPDATE, _BYTES_UPDATE_PAIR, _BYTES_UPDATE_QUAD = 185, 9, 46
_BYTES_CLAMPED, _BYTES_SEARCHED = 26, 52
_STACK = 128


def instructions(layout: Layout, target: Target) -> int:
    """Return how many instructions classify takes at most, roughly."""
    core, parts = _CORES.get(target.part, _OTHERS), len(parts_of(layout.tables.n_classes).firsts)
    row = core.part + _words(layout) * (core.pair if layout.entry_bits == 16 else core.quad)
    a_class = core.a_class + (core.in_parts if parts > 1 else 0)
    return layout.n_lookups * (core.lookup + parts * row) + a_class * layout.tables.n_classes + _finding(layout)


def update_instructions(layout: Layout, target: Target) -> int:
    """Return how many instructions update takes at most, roughly: where every row is replaced."""
    parts = len(parts_of(layout.tables.n_classes).firsts)
    pair, quad = _REPLACED.get(target.part, _REPLACED_OTHERS)
    replaced = _REPLACING + parts * _words(layout) * (pair if layout.entry_bits == 16 else quad)
    core = _CORES.get(target.part, _OTHERS)
    a_class = core.a_class + (core.in_parts if parts > 1 else 0)
    return layout.n_lookups * (core.lookup + replaced) + a_class * layout.tables.n_classes + _finding(layout)


def _words(layout: Layout) -> int:
    """Return how many words a row has."""
    return -(-parts_of(layout.tables.n_classes).width * layout.entry_bits // 32)


def _finding(layout: Layout) -> int:
    """Return the instructions that finding rows takes beyond those of a direct look-up."""
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


def flash(layout: Layout) -> int:
    """Return the bytes of tables and code, update() left out, at most, roughly; the names of the grasp types come on
    top.
    """
    parts, words = parts_of(layout.tables.n_classes), _words(layout)
    joints = [joint for joint in layout.joints if not joint.constant]
    found = sum(len(joint.bins) for joint in joints)
    finding = {"direct": 0, "trimmed": _BYTES_CLAMPED, "search": _BYTES_SEARCHED}[layout.bins]
    if layout.bins == "search":
        found = sum(len(joint.thresholds) for joint in joints) * layout.code_bits // 8
    rows = 4 * layout.n_rows * words * len(parts.firsts)
    places = layout.tables.n_switches * (2 if len(layout.groups) <= 255 else 4)
    starts = 2 * len(parts.firsts) * (2 * parts.width + 8)  # of the sums, constant and as they are in the beginning
    starts += 2 * layout.tables.n_classes + 4 * layout.n_lookups  # scores, and rows added, in the beginning
    code = _BYTES + (_BYTES_PARTS if len(parts.firsts) > 1 else 0) + _BYTES_CLASS * parts.width
    code += _BYTES_LOOKUP * layout.n_lookups + words * (_BYTES_PAIR if layout.entry_bits == 16 else _BYTES_QUAD)
    return rows + found + places + starts + code + finding * len(joints)


def update_flash(layout: Layout) -> int:
    """Return the bytes of update(), at most, roughly."""
    return _BYTES_UPDATE + _words(layout) * (_BYTES_UPDATE_PAIR if layout.entry_bits == 16 else _BYTES_UPDATE_QUAD)


def ram(layout: Layout) -> int:
    """Return the bytes of variables and stack, roughly."""
    classes = layout.tables.n_classes
    frame = len(layout.groups) + layout.padding + layout.tables.n_joints * layout.code_bits // 8
    rows = 2 * 4 * layout.n_lookups  # pointers to those added, and in update() to those that are now
    return frame + 2 * classes + 2 * (classes + 6) + rows + _STACK
