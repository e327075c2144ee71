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
