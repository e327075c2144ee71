"""The cost of a classifier on a target: one linear formula of a few terms, whose coefficients stand with the target.

`benchmarks/firmwarefit.py` fits them to the cycles that simavr counts, or the instructions that qemu counts, for the
slowest of many frames, and to the sizes that the toolchain reports. A slow test bounds the errors of the formula.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from .layout import Layout

Unit = Literal["cycles", "instructions", ""]

NAME_BYTES = 16  # each name takes as much room as the longest, and there is one more, which is empty


@dataclass(frozen=True, slots=True)
class Cost:
    """The estimated cost of a classifier.

    cycles  of classify() for the slowest frame; instructions except on an AVR
    flash   bytes of all of it, with names of grasp types of up to 15 bytes
    ram     bytes of a glove, without the stack
    """

    cycles: int
    flash: int
    ram: int


@dataclass(frozen=True, slots=True)
class Formula:
    """The cost of a classifier as three sums of coefficients times `terms`; a term that is not named costs nothing."""

    cycles: Mapping[str, float]
    flash: Mapping[str, float]
    ram: Mapping[str, float]

    def cost(self, layout: "Layout") -> Cost:
        """Return the cost of a layout."""
        found = terms(layout)
        times, flash, ram = (
            sum(each * found[name] for name, each in part.items()) for part in (self.cycles, self.flash, self.ram)
        )
        return Cost(round(times), round(flash) + NAME_BYTES * (layout.tables.n_classes + 1), round(ram))


# The bytes of a glove are the same on all cores of 32 bits.
RAM_OF_32_BITS: Mapping[str, float] = {
    "one": 7.194,
    "byte classes": 0.7187,
    "found": 1.939,
    "kept found": 0.1425,
    "sum words": 12.53,
    "compared codes": 1.396,
    "ports": 3.09,
    "input": 1.755,
}


def terms(layout: "Layout") -> dict[str, float]:
    """Return how often each term occurs in a layout.

    word classes, byte classes   with sums of 16 or of 8 bits
    passes, class passes         over all lookups, where one is not enough: their number, and that times the classes
    lookups, kept lookups        rows that are added in all passes; and those which an AVR finds before it adds any
    words, entries, offsets      of rows that are added: words of 32 bits, bytes, bytes that are added to wider sums
    split words                  words of such bytes that portable C takes apart, a batch at a time
    fields                       of switches that are cut out of the bytes of ports
    bins, thresholds, searches   joints that are looked up; thresholds that are compared; steps of binary searches
    lines, line sums             joints that are multiplied in all passes, and the sums that each is added to
    found, kept found            rows and distances of a frame, which update() keeps; those that an AVR finds first
    sum words, compared codes    words of sums; codes that update() keeps
    ports                        bytes of switches
    found words, split code      words of rows, and words that are taken apart, in one pass
    rows, padded rows, tables    bytes of rows, on an AVR and in words; bytes of bins and means
    input                        bytes of a frame
    """
    from .assembly import finds_first
    from .layout import MOST_INLINE

    tables, parts = layout.tables, layout.parts
    passes, lines, bits = len(parts.firsts), len(tables.slopes), layout.entry_bits
    lookups, words = passes * len(layout.lookups), -(-parts.width * bits // 32)
    entries = parts.width * bits // 8
    steps = [len(joint.thresholds) for joint in layout.joints if joint.compared]
    binned = [len(joint.bins) for joint in layout.joints if not joint.compared]
    means = layout.means.size * (1 if layout.narrow_means else 2)
    return {
        "one": 1,
        "word classes": tables.n_classes * (layout.sum_bits == 16),
        "byte classes": tables.n_classes * (layout.sum_bits == 8),
        "passes": passes - 1,
        "class passes": tables.n_classes * (passes > 1),
        "lookups": lookups,
        "kept lookups": lookups * finds_first(layout),
        "words": lookups * words,
        "entries": lookups * entries,
        "offsets": lookups * entries * (layout.biased and not layout.entry_shift),
        "split words": passes * len(layout.batches) * words * layout.biased,
        "fields": sum(map(len, layout.fields)),
        "bins": len(binned),
        "thresholds": sum(steps),
        "searches": sum(n.bit_length() for n in steps if n > MOST_INLINE),
        "lines": passes * lines,
        "line sums": passes * lines * parts.width,
        "found": len(layout.lookups) + lines,
        "kept found": (len(layout.lookups) + lines) * finds_first(layout),
        "sum words": passes * -(-parts.width * layout.sum_bits // 32),
        "compared codes": len(layout.joints) * (layout.code_bits == 8),
        "ports": len(layout.ports),
        "found words": len(layout.lookups) * words,
        "split code": len(layout.batches) * words * layout.biased,
        "rows": layout.n_rows * passes * entries,
        "padded rows": layout.n_rows * passes * words * 4,
        "tables": sum(binned) + means,
        "input": layout.frame_size,
    }
