"""The port expanders and converters: one file per chip, with all its data."""

from ...members import Members
from .base import Chip, ChipPackage, Conversion, Converter, Device, Reading, Write, byte_pins, port_pins

__all__ = [
    "CHIPS",
    "Chip",
    "ChipPackage",
    "Conversion",
    "Converter",
    "Device",
    "Reading",
    "Write",
    "byte_pins",
    "expanders",
    "port_pins",
]

CHIPS = Members("I2C chip", Chip, __name__, "thenar.chips")  # type: ignore[type-abstract]


def expanders() -> dict[str, Chip]:
    """Return the chips that read switches, by name."""
    return {name: chip for name, chip in CHIPS.items() if not isinstance(chip, Converter)}
