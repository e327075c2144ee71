"""The converters on SPI: one file per chip, with all its data."""

from ...members import Members
from .base import SELECT_US, SpiChip, SpiModel, Transfer

__all__ = ["SELECT_US", "SPI_CHIPS", "SpiChip", "SpiModel", "Transfer"]

SPI_CHIPS = Members("SPI converter", SpiChip, __name__, "thenar.spi_chips")  # type: ignore[type-abstract]
