"""Espressif's chips with Wi-Fi: packages that differ in the cost of their core and in the pins of the example.

Pins are those of the GPIO tables of the ESP-IDF Programming Guide. Pins are left out if they are strapping pins, belong
to the flash, the PSRAM or the USB port, have no pull-up (which only analog inputs may lack), or are missing on some
chips or modules. Analog pins are those of ADC1, since ADC2 does not convert while Wi-Fi is on.
"""

from .base import Formula
from .package import M4, Package, family
from .riscv import MEMBER as _RISCV


def _esp(name: str, what: str, formula: Formula | None = M4, **pins: tuple[int, ...]) -> Package:
    return family(name, formula, what, rank=31, flash=16 << 20, ram=256 << 10, **pins)


MEMBER = (
    # GPIO16 and 17 are a WROVER's PSRAM, but free on the usual WROOM-32.
    _esp(
        "esp32",
        "a package for ESP-IDF, Arduino, PlatformIO, Zephyr: ESP32 (Xtensa)",
        digital=(4, 5, 13, 14, *range(16, 20), 21, 22, 23, 25, 26, 27),
        analog=(36, 39, 32, 33, 34, 35),
    ),
    _esp(
        "esp32s2",
        "a package as for esp32: ESP32-S2 (Xtensa)",
        digital=(*range(11, 19), 21, *range(33, 43)),
        analog=tuple(range(1, 11)),
    ),
    # GPIO33 to 37 are the octal PSRAM's of many modules; 47 and 48 have 1.8 V on an ESP32-S3R8V.
    _esp(
        "esp32s3",
        "a package as for esp32: ESP32-S3 (Xtensa)",
        digital=(*range(11, 19), 21, *range(38, 43)),
        analog=(1, 2, *range(4, 11)),
    ),
    _esp(
        "esp32c3",
        "a package as for esp32: ESP32-C3 (RISC-V)",
        formula=_RISCV.formula,
        digital=(5, 6, 7, 10),
        analog=(0, 1, 3, 4),
    ),
    _esp(
        "esp32c6",
        "a package as for esp32: ESP32-C6, H2 (RISC-V)",
        formula=_RISCV.formula,
        digital=(7, *range(18, 24)),
        analog=(0, 1, 2, 3, 6),
    ),
)
