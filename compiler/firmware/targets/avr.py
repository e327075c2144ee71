"""AVRs: the parts of Arduino's Uno and Mega."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar

from ..costs import Formula
from ..tools import AVR_COMPILER
from .base import Target

if TYPE_CHECKING:
    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Frames, Lost, Predictions


@dataclass(frozen=True, kw_only=True)
class Avr(Target):
    """An AVR; programmer is the boot loader of its usual boards, in avrdude."""

    avr: ClassVar[bool] = True

    programmer: str

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text: the library, a Makefile (program, size, flash) and an initial main()."""
        from thenar.firmware_templates.rendering import render

        name, layout = library.name, library.layout
        values = {"name": name, "part": self.part, "programmer": self.programmer, "objects": library.objects}
        inputs = {"switches": layout.tables.n_switches, "joints": layout.tables.n_joints}
        return {
            **library.whole,
            "Makefile": render("avr_library/Makefile.j2", **values),
            "main.c": render("avr_library/main.c.j2", name=name, upper=name.upper(), **inputs),
        }

    def missing(self) -> str | None:
        """Return which of avr-gcc and simavr is missing, and how to install it; None if neither is."""
        from ..simavr import missing

        return missing()

    def run(
        self,
        files: Mapping[str, str],
        name: str,
        layout: "Layout",
        frames: "Frames",
        *,
        incremental: bool = False,
        lost: "Lost | None" = None,
    ) -> "Predictions":
        """Return the predictions for frames (n, F) in simavr, as in the base class, with their cycles and stack."""
        from ..simavr import run

        return run(files, name, layout, frames, self.part, self.flags, incremental=incremental, lost=lost)


# `lpm` reaches the first 64 KiB of the flash, which the tables share with all other constants. The clocks are those of
# Arduino's boards.
_avr = partial(
    Avr,
    help="a library with a Makefile",
    next_step="`make -C {folder}` compiles it",
    carried=True,
    most_flash=48 << 10,
    clock_hz=16_000_000,
    kind="avr",
    compiler=AVR_COMPILER,
    size=(("avr-size",), "binutils-avr"),
)

_ATMEGA328P = _avr(
    name="avr328p",
    formula=Formula(
        cycles={
            "word classes": 17.25,
            "byte classes": 13.85,
            "class passes": 6.879,
            "lookups": 17.48,
            "kept lookups": 1.979,
            "entries": 4.099,
            "offsets": 1.073,
            "fields": 1.624,
            "bins": 8.079,
            "thresholds": 2.822,
            "searches": 3.08,
            "lines": 24.94,
            "line sums": 2.97,
        },
        flash={
            "one": 606.4,
            "word classes": 44.16,
            "byte classes": 41.78,
            "passes": 30.85,
            "lookups": 28.53,
            "kept lookups": 23.61,
            "words": 2.299,
            "split words": 0.6298,
            "found": 26.87,
            "found words": 0.2661,
            "fields": 5.778,
            "bins": 196.3,
            "thresholds": 12.42,
            "lines": 114.1,
            "line sums": 3.144,
            "rows": 1.188,
            "tables": 0.2109,
        },
        ram={
            "one": 6.538,
            "word classes": 4.188,
            "byte classes": 3.894,
            "found": 1.912,
            "kept found": 1.016,
            "compared codes": 0.7032,
            "input": 0.6822,
        },
    ),
    part="atmega328p",
    rank=10,
    flags=("-mmcu=atmega328p", "-Os"),
    flash=32 << 10,
    ram=2 << 10,
    programmer="arduino",
)

_ATMEGA2560 = _avr(
    name="avr2560",
    formula=Formula(
        cycles={
            "one": 1.099,
            "word classes": 18.22,
            "byte classes": 14.28,
            "class passes": 6.133,
            "lookups": 19.76,
            "kept lookups": 2.517,
            "entries": 4.061,
            "offsets": 1.038,
            "fields": 1.775,
            "bins": 8.297,
            "thresholds": 2.834,
            "searches": 3.029,
            "lines": 26.38,
            "line sums": 3.005,
        },
        flash={
            "one": 612.9,
            "word classes": 44.63,
            "byte classes": 41.84,
            "passes": 22.68,
            "lookups": 28.98,
            "kept lookups": 23.87,
            "words": 1.969,
            "split words": 0.4869,
            "found": 26.56,
            "found words": 0.4267,
            "fields": 5.621,
            "bins": 195.6,
            "thresholds": 12.44,
            "lines": 113.0,
            "line sums": 3.217,
            "rows": 1.19,
            "tables": 0.2199,
        },
        ram={
            "one": 6.538,
            "word classes": 4.188,
            "byte classes": 3.894,
            "found": 1.912,
            "kept found": 1.016,
            "compared codes": 0.7032,
            "input": 0.6822,
        },
    ),
    part="atmega2560",
    rank=11,
    flags=("-mmcu=atmega2560", "-Os"),
    flash=256 << 10,
    ram=8 << 10,
    programmer="wiring",
)

MEMBER = (_ATMEGA328P, _ATMEGA2560)
