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

        name, tables = library.name, library.layout.tables
        values = {"name": name, "part": self.part, "programmer": self.programmer, "objects": library.objects}
        inputs = {"switches": tables.n_switches, "joints": tables.n_joints}
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
        lost: "Lost | None" = None,
    ) -> "Predictions":
        """Return the predictions for frames (n, F) in simavr, as in the base class, with their cycles and stack."""
        from ..simavr import run

        return run(files, name, layout, frames, self.part, self.flags, lost=lost)


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
            "one": 378.1,
            "blocks": 136.5,
            "classes": 34.9,
            "bytes": 71.78,
            "groups": 33.38,
            "rows": 112.9,
            "lines": 122.9,
            "distances": 73.62,
            "shifts": 6.288,
            "bins": 121.9,
            "halves": 30.26,
        },
        flash=2288,
        ram=60,
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
            "one": 379.1,
            "blocks": 136.6,
            "classes": 34.9,
            "bytes": 71.77,
            "groups": 33.38,
            "rows": 112.9,
            "lines": 122.9,
            "distances": 73.58,
            "shifts": 6.299,
            "bins": 123.9,
            "halves": 30.26,
        },
        flash=2292,
        ram=60,
    ),
    part="atmega2560",
    rank=11,
    flags=("-mmcu=atmega2560", "-Os"),
    flash=256 << 10,
    ram=8 << 10,
    programmer="wiring",
)

MEMBER = (_ATMEGA328P, _ATMEGA2560)
