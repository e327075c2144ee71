"""The port expanders: one file a chip, which holds everything that is true of it."""

from ...members import Members
from .base import Chip, Device, Package, Reading, Write, byte_pins, port_pins

__all__ = ["CHIPS", "Chip", "Device", "Package", "Reading", "Write", "byte_pins", "port_pins"]

CHIPS = Members("I2C chip", Chip, __name__, "thenar.chips")  # type: ignore[type-abstract]
