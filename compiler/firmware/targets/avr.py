"""AVRs: the parts of Arduino's Uno and Mega, with the pins and the baud rates for board firmware."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar

from ..costs import Formula
from ..tools import AVR_COMPILER
from .wired import Wired

if TYPE_CHECKING:
    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Frames, Lost, Predictions

_DIVIDERS = 4096
_USUAL = (9600, 19_200, 38_400, 57_600, 76_800, 115_200, 230_400, 250_000, 500_000, 1_000_000, 2_000_000)
_EXACT = 0.005


@dataclass(frozen=True, kw_only=True)
class Avr(Wired):
    """An AVR. Its pins exclude crystal and reset.

    jtag      pins that the JTAG interface occupies until it is disabled
    avrdude   its name in avrdude, and `programmer` the usual boards' boot loader there
    brown_out the recommended brown-out fuses at its highest clock
    """

    avr: ClassVar[bool] = True

    jtag: tuple[str, ...]
    highest_hz: int
    avrdude: str
    programmer: str
    brown_out: str = "4.3 V, extended fuse 0xFC; at 8 MHz or less 2.7 V, 0xFD"

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


@dataclass(frozen=True, slots=True)
class BaudSetting:
    """The values of UBRRn and of U2Xn, and the resulting error of the rate, as a fraction."""

    ubrr: int
    double: bool
    error: float


def best_setting(baud: int, clock_hz: int) -> BaudSetting | None:
    """Return the setting nearest to `baud`, with a clock divider of 16 or 8 (U2X) times UBRRn + 1; None if none exists.

    Of equally near ones it is the one without U2X, whose receiver samples twice as often and tolerates more error.
    """
    found = [setting for double in (False, True) if (setting := _setting(baud, clock_hz, double))]
    return min(found, key=lambda setting: (abs(setting.error), setting.double), default=None)


def near_rates(baud: int, clock_hz: int) -> tuple[int, ...]:
    """Return the four standard rates nearest to `baud` with an error of at most half a percent, in rising order."""
    good = [rate for rate in _USUAL if (best := best_setting(rate, clock_hz)) and abs(best.error) < _EXACT]
    return tuple(sorted(sorted(good, key=lambda rate: abs(rate - baud))[:4]))


def _setting(baud: int, clock_hz: int, double: bool) -> BaudSetting | None:
    step = 8 if double else 16
    ubrr = max(round(clock_hz / (step * baud)) - 1, 0)
    return BaudSetting(ubrr, double, clock_hz / (step * (ubrr + 1)) / baud - 1.0) if ubrr < _DIVIDERS else None


def _pins(**ports: int) -> tuple[str, ...]:
    return tuple(f"P{port}{bit}" for port, count in ports.items() for bit in range(count))


def _channels(*ports: str) -> dict[str, str]:
    return {f"ADC{8 * place + bit}": f"P{port}{bit}" for place, port in enumerate(ports) for bit in range(8)}


# `lpm` reaches the first 64 KiB of the flash, which the tables share with all other constants. The clocks are those of
# Arduino's boards.
_avr = partial(
    Avr,
    help="a library with a Makefile, or the complete firmware of a board",
    next_step="`make -C {folder}` compiles it",
    carried=True,
    most_flash=48 << 10,
    clock_hz=16_000_000,
    kind="avr",
    compiler=AVR_COMPILER,
    size=(("avr-size",), "binutils-avr"),
)

# ATmega48A/PA/88A/PA/168A/PA/328/P, DS40002061: PB6 and PB7 carry the crystal, PC6 is RESET; ADC6 and ADC7 have
# separate pins, which only the packages with 32 leads have.
_ATMEGA328P = _avr(
    name="avr328p",
    formula=Formula(
        cycles={
            "word classes": 17.48,
            "byte classes": 16.57,
            "class passes": 9.246,
            "lookups": 10.44,
            "kept lookups": 2.412,
            "entries": 4.089,
            "offsets": 1.199,
            "split words": 5.197,
            "fields": 5.606,
            "bins": 16.96,
            "thresholds": 3.973,
            "lines": 36.91,
            "line sums": 1.24,
        },
        flash={
            "one": 595.0,
            "word classes": 52.52,
            "byte classes": 50.54,
            "lookups": 43.34,
            "kept lookups": 14.88,
            "words": 0.8615,
            "found words": 2.705,
            "split code": 13.71,
            "bins": 183.9,
            "thresholds": 15.21,
            "lines": 91.7,
            "line sums": 7.286,
            "rows": 1.16,
            "tables": 0.312,
        },
        ram={
            "one": 9.043,
            "word classes": 4.158,
            "byte classes": 3.825,
            "found": 1.993,
            "kept found": 0.8861,
            "compared codes": 0.3211,
            "input": 0.5797,
        },
    ),
    part="atmega328p",
    rank=10,
    flags=("-mmcu=atmega328p", "-Os"),
    flash=32 << 10,
    ram=2 << 10,
    pins=_pins(B=6, C=6, D=8),
    uarts=(("PD0", "PD1"),),
    twi=("PC4", "PC5"),
    analog=_channels("C") | {"ADC6": "", "ADC7": ""},
    jtag=(),
    highest_hz=20_000_000,
    avrdude="m328p",
    programmer="arduino",
)

# ATmega640/1280/1281/2560/2561, DS40002211: crystal and RESET have separate pins.
_ATMEGA2560 = _avr(
    name="avr2560",
    formula=Formula(
        cycles={
            "one": 48.5,
            "word classes": 12.86,
            "byte classes": 14.39,
            "passes": 128.1,
            "class passes": 6.904,
            "lookups": 5.202,
            "kept lookups": 2.339,
            "words": 1.652,
            "entries": 3.89,
            "offsets": 1.721,
            "fields": 8.179,
            "bins": 19.49,
            "thresholds": 4.88,
            "lines": 42.23,
            "line sums": 1.573,
        },
        flash={
            "one": 667.8,
            "word classes": 51.28,
            "byte classes": 49.02,
            "lookups": 19.24,
            "kept lookups": 26.97,
            "split words": 12.17,
            "found": 25.66,
            "found words": 2.659,
            "bins": 116.0,
            "thresholds": 13.97,
            "lines": 40.65,
            "line sums": 10.09,
            "rows": 1.104,
            "tables": 0.6014,
        },
        ram={
            "one": 7.37,
            "word classes": 4.224,
            "byte classes": 3.928,
            "found": 2.239,
            "kept found": 0.8611,
            "compared codes": 0.2158,
            "input": 0.4392,
        },
    ),
    part="atmega2560",
    rank=11,
    flags=("-mmcu=atmega2560", "-Os"),
    flash=256 << 10,
    ram=8 << 10,
    pins=_pins(A=8, B=8, C=8, D=8, E=8, F=8, G=6, H=8, J=8, K=8, L=8),
    uarts=(("PE0", "PE1"), ("PD2", "PD3"), ("PH0", "PH1"), ("PJ0", "PJ1")),
    twi=("PD1", "PD0"),
    analog=_channels("F", "K"),
    jtag=("PF4", "PF5", "PF6", "PF7"),
    highest_hz=16_000_000,
    avrdude="m2560",
    programmer="wiring",
)

MEMBER = (_ATMEGA328P, _ATMEGA2560)
AVRS: Mapping[str, Avr] = {part.part: part for part in MEMBER}
"""The parts that board firmware supports, by their names in board.toml."""
