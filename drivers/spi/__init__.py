"""Converters on SPI, through the kernel's spidev: one chip a file."""
