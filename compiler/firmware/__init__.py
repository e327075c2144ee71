"""Firmware: a build as C99, laid out for its microcontroller."""

from thenar.drivers.errors import ThenarError


class FirmwareError(ThenarError, ValueError):
    """The firmware cannot be made: tables that do not fit, a board that lacks a switch, an unknown part."""
