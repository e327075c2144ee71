"""Converters on SPI, through the kernel's spidev: one file per chip."""
