"""The cost of a classifier in portable C, which adds words of two sums, by a model that is rough but not too low.

The model is fitted to the instructions that qemu counts on four cores for code by gcc with -O2: 2 to 40 classes, 2 to
28 lookups from the bytes of ports, and slopes. With 5 classes and 4 lookups or more and no slope, it is 1 to 58 % above
them on a Cortex-M4 for classify() and 4 to 24 % for update(); on the other cores up to 73 % and 40 %. With slopes
alone, classify() may take a sixth of what the model says. Entries of 8 bits that are added up in 16 are faster than
those of 16 bits where many rows fit in a batch, and slower where few do. Other compilers and cores differ.
"""

from dataclasses import dataclass
from typing import Literal

from .layout import MOST_INLINE, JointLayout, Layout

Unit = Literal["cycles", "instructions", ""]

NAME_BYTES = 16  # each name takes as much room as the longest, and there is one more, which is empty


@dataclass(frozen=True, slots=True)
class Cost:
    """The most that a classifier takes.

    cycles          of classify() for any frame; instructions except on an AVR
    update_cycles   of update(), whatever has changed
    flash           bytes of all of it, with names of grasp types of up to 15 bytes, of C compiled with
                    -ffunction-sections -fdata-sections
    flash_classify  the part of these bytes in a program that never calls update() and never marks an input as missing,
                    where the linker removes uncalled functions (--gc-sections)
    ram             bytes, stack included, for either function
    """

    cycles: int
    update_cycles: int
    flash: int
    flash_classify: int
    ram: int


@dataclass(frozen=True, slots=True)
class Updating:
    """Instructions of update() in the model, each per item, where it adds all rows again after it has found them.

    That takes longest: fewer rows are replaced only where this is faster.

    fixed             of a prediction
    a_class, in_parts of a class; in addition where classes are added up in parts
    noted             of a lookup whose row has changed
    added, pair, quad of a lookup in each part; of a word of two or four of its entries
    split             of a word of a batch of 8-bit entries that is split
    moved, moved_part of a slope; of one in each part
    product, halves   of a word of two sums that a slope adds to; of one of upper halves, once
    """

    fixed: int
    a_class: int
    in_parts: int
    noted: int
    added: int
    pair: int
    quad: int
    split: int
    moved: int
    moved_part: int
    product: int
    halves: int


@dataclass(frozen=True, slots=True)
class Core:
    """Instructions of the model, each per item.

    fixed            of a prediction
    a_class, in_parts          of a class; in addition where classes are added up in parts
    lookup, found              of a lookup; of a joint in it
    part, pair                 of a lookup in each part; of a word of its entries
    quad                       of a word of a batch of 8-bit entries that is split
    updating                   of update()
    product                    of a word of two sums that a slope adds to
    compared                   of a threshold that is compared
    """

    fixed: int

    a_class: int
    in_parts: int
    lookup: int
    found: int
    part: int
    pair: int
    quad: int
    updating: Updating
    product: int = 2
    compared: int = 2


CORTEX_M4 = Core(
    fixed=30,
    a_class=6,
    in_parts=9,
    lookup=0,
    found=5,
    part=1,
    pair=2,
    quad=3,
    updating=Updating(
        fixed=9,
        a_class=9,
        in_parts=3,
        noted=2,
        added=16,
        pair=1,
        quad=2,
        split=1,
        moved=0,
        moved_part=16,
        product=2,
        halves=2,
    ),
)
"""The assumed costs of other 32-bit cores."""


# Of a class where four entries of 8 bits share a word, added up in 16 bits or in 8.
_BIASED_CLASS, _NARROW_CLASS = 3, 2
# In addition to a code that is looked up directly: a byte clamped below and above, where it can lie there; a code of 16
# bits clamped; a code searched, and each step of the search.
_BELOW, _ABOVE, _WIDE = 4, 2, 8
_SEARCHED, _SEARCH_STEP = 16, 11
# In classify(), the distance of a code, looked up or not; in each part all but the products; and of each word of sums,
# at the end and where entries are upper halves.
_DISTANCE_KNOWN, _DISTANCE, _MULTIPLYING, _WORD, _HALVES = 7, 14, 76, 2, 8

# Of code; more where classes are added up in parts.
_BYTES, _BYTES_PARTS, _BYTES_CLASS = 186, 432, 15
_BYTES_WORD, _BYTES_QUAD, _BYTES_START = 7, 20, 41
_BYTES_UPDATE, _BYTES_UPDATE_CLASS, _BYTES_UPDATE_PAIR, _BYTES_UPDATE_QUAD = 169, 8, 38, 151
_BYTES_NOTED, _BYTES_PLACE, _BYTES_PLACE_COMPARED = 58, 40, 15
_BYTES_JOINT, _BYTES_CLAMPED, _BYTES_COMPARED, _BYTES_SEARCHED = 11, 35, 11, 55
_BYTES_MULTIPLYING, _BYTES_PRODUCT, _BYTES_DISTANCE = 150, 30, 24
# Instructions that extract a field of a port's byte, and that check that nothing is missing.
_FIELD, _MISSING = 3, 3
_STACK = 150


def word_cost(layout: Layout, core: Core) -> Cost:
    """Return the estimated cost of the portable C on a core."""
    parts, classes = len(layout.parts.firsts), layout.tables.n_classes
    words, finding = _words(layout), sum(_finding(layout, joint, core) for joint in layout.joints)
    finding += _MISSING + _FIELD * sum(map(len, layout.fields))
    adding = parts * len(layout.lookups) * (core.part + words * core.pair)
    adding += parts * len(layout.batches) * words * core.quad * layout.biased
    a_class = core.a_class + (core.in_parts if parts > 1 else 0)
    a_class += _BIASED_CLASS if layout.biased else _NARROW_CLASS if layout.entry_bits == 8 else 0
    classify = a_class * classes + finding + core.fixed + len(layout.lookups) * core.lookup + adding
    classify += _multiplying(layout, core)
    flash = _flash(layout) + NAME_BYTES * (classes + 1)
    update = finding + _updating(layout, core.updating)
    return Cost(classify, update, flash + _update_flash(layout), flash, _ram(layout))


def _updating(layout: Layout, core: Updating) -> int:
    """Return the instructions of update() without those that find rows."""
    parts, words, lookups = len(layout.parts.firsts), _words(layout), len(layout.lookups)
    a_class = core.a_class + (core.in_parts if parts > 1 else 0)
    row = core.added + words * (core.quad if layout.biased else core.pair)
    adding = lookups * (core.noted + parts * row) + parts * len(layout.batches) * words * core.split * layout.biased
    slopes = len(layout.tables.slopes)
    lanes = 2 * -(-layout.parts.width // 4) if layout.biased else -(-layout.parts.width // 2)
    moving = slopes * (core.moved + parts * (core.moved_part + lanes * core.product))
    if slopes and layout.entry_shift:
        moving += parts * lanes * core.halves
    return core.fixed + a_class * layout.tables.n_classes + adding + moving


def _multiplying(layout: Layout, core: Core) -> int:
    """Return the instructions of slopes in classify(), where sums are in registers."""
    slopes, width, parts = len(layout.tables.slopes), layout.parts.width, len(layout.parts.firsts)
    if not slopes:
        return 0
    word = slopes * core.product + _WORD + (core.product + _HALVES if layout.entry_shift else 0)
    distance = _DISTANCE_KNOWN if layout.stores_distances else _DISTANCE
    return slopes * distance + parts * (_MULTIPLYING + -(-width // 2) * word)


def _words(layout: Layout) -> int:
    """Return the number of words in a row."""
    return -(-layout.parts.width * layout.entry_bits // 32)


def _finding(layout: Layout, joint: JointLayout, core: Core) -> int:
    """Return the instructions of a joint in finding a row."""
    if joint.compared:
        steps = len(joint.thresholds)
        return core.found + (
            core.compared * steps if steps <= MOST_INLINE else _SEARCHED + _SEARCH_STEP * steps.bit_length()
        )
    if len(joint.bins) == 1 << layout.code_bits:
        return core.found
    if layout.code_bits == 16:
        return core.found + _WIDE
    above = joint.first + len(joint.bins) <= 255
    return core.found + _BELOW * (joint.first > 0) + _ABOVE * above


def _flash(layout: Layout) -> int:
    """Return an upper estimate of the bytes of tables and code without update(); the names of the grasp types are added
    to this.
    """
    parts, words, lookups = layout.parts, _words(layout), len(layout.lookups)
    rows = 4 * layout.n_rows * words * len(parts.firsts) + sum(len(joint.bins) for joint in layout.joints)
    places = layout.tables.n_switches * (2 if len(layout.ports) <= 255 else 4)
    starts = 2 * len(parts.firsts) * (2 * parts.width + 8)  # of the sums: constants and initial values
    starts += 2 * layout.tables.n_classes + 4 * lookups  # initial scores, and rows added at first
    code = _BYTES + (_BYTES_PARTS if len(parts.firsts) > 1 else 0) + _BYTES_CLASS * parts.width
    code += words * ((_BYTES_WORD + 2 * layout.biased) * lookups + _BYTES_START)
    code += words * _BYTES_QUAD * len(layout.batches) if layout.biased else 0
    if slopes := len(layout.tables.slopes):
        lanes = -(-parts.width // 2)
        code += _BYTES_MULTIPLYING + _BYTES_PRODUCT * lanes + _BYTES_DISTANCE * slopes
        code += 256 * slopes * layout.stores_distances
        starts += slopes * (2 + 4 * lanes * len(parts.firsts))
    return rows + places + starts + code + sum(_joint_flash(layout, joint) for joint in layout.joints)


def _update_flash(layout: Layout) -> int:
    """Return an upper estimate of the bytes of update() and of what replaces missing inputs."""
    word = _BYTES_UPDATE_QUAD if layout.biased else _BYTES_UPDATE_PAIR
    code = _BYTES_UPDATE + _BYTES_UPDATE_CLASS * layout.tables.n_classes + _words(layout) * word
    code += _BYTES_NOTED * len(layout.lookups)
    for joint in layout.joints:  # update() has its own code to find rows
        if joint.compared:
            code += _BYTES_PLACE_COMPARED
        elif len(joint.bins) < 1 << layout.code_bits:
            code += _BYTES_PLACE
    return code + layout.means.size * (1 if layout.narrow_means else 2)


def _joint_flash(layout: Layout, joint: JointLayout) -> int:
    """Return the bytes of code for a joint, its thresholds included."""
    steps = len(joint.thresholds)
    if not joint.compared:
        return _BYTES_JOINT + (0 if len(joint.bins) == 1 << layout.code_bits else _BYTES_CLAMPED)
    if steps <= MOST_INLINE:
        return _BYTES_JOINT + _BYTES_COMPARED * steps
    return _BYTES_JOINT + _BYTES_SEARCHED + steps * layout.code_bits // 8


def _ram(layout: Layout) -> int:
    """Return the estimated bytes of variables and stack."""
    classes = layout.tables.n_classes
    lost = len(layout.ports) + -(-layout.tables.n_joints // 8) + 4
    frame = len(layout.ports) + layout.padding + layout.tables.n_joints * layout.code_bits // 8
    rows = 4 * 4 * len(layout.lookups)  # pointers to the rows added and, in update(), to those found, before and after
    slopes = 8 * len(layout.tables.slopes)  # the distances added and, in update(), their changes
    return frame + 2 * classes + 4 * (classes + 6) + lost + rows + slopes + _STACK
