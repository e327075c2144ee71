"""The cost of a classifier on a target: the core's, which is the same for every build, and that of its tables.

Flash is the size of the compiled core and the exact bytes of the tables, RAM is exact. Time is a sum of a few terms,
whose coefficients `benchmarks/firmwarefit.py` fits to the cycles that simavr counts, or the instructions that qemu
counts, for the slowest of many frames. A slow test bounds the errors.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from .layout import Layout

Unit = Literal["cycles", "instructions", ""]

NAME_BYTES = 16  # of a grasp type's name, its end included, where the names are not known


@dataclass(frozen=True, slots=True)
class Cost:
    """The estimated cost of a classifier.

    cycles  of thenar_classify() for the slowest frame; instructions except on an AVR
    flash   bytes of all of it, with names of grasp types of up to 15 bytes, without rejection and segments
    ram     bytes of a hand, without the stack
    """

    cycles: int
    flash: int
    ram: int


@dataclass(frozen=True, slots=True)
class Formula:
    """The cost of a classifier: `cycles` a term of `terms`, the bytes of the core in flash and in RAM."""

    cycles: Mapping[str, float]
    flash: int
    ram: int

    def cost(self, layout: "Layout", *, avr: bool) -> Cost:
        """Return the cost of a layout."""
        found = terms(layout)
        time = sum(each * found[name] for name, each in self.cycles.items())
        names = NAME_BYTES * layout.tables.n_classes
        return Cost(round(time), self.flash + layout.table_bytes(avr=avr) + names, self.ram + 2 * layout.memory)


def terms(layout: "Layout") -> dict[str, int]:
    """Return how often each term of the time occurs in a layout.

    blocks        of eight grasp types, which are added up at once
    classes       whose sums are compared
    bytes         of switches
    groups        of switches, whose rows are found
    rows, lines   that are added, in all blocks
    distances     of lines, and `shifts` of their codes
    bins, halves  joints whose thresholds are searched, and the comparisons
    """
    tables, blocks = layout.tables, -(-layout.row_pairs // 4)
    return {
        "one": 1,
        "blocks": blocks,
        "classes": tables.n_classes,
        "bytes": -(-tables.n_switches // 8),
        "groups": len(layout.groups),
        "rows": layout.found * blocks,
        "lines": len(tables.slopes) * blocks,
        "distances": len(tables.slopes),
        "shifts": sum(abs(line.gain) for line in tables.slopes),
        "bins": len(layout.bins),
        "halves": sum(len(bins.thresholds).bit_length() for bins in layout.bins),
    }
