"""Firmware: a build as C99, arranged for the microcontroller that it is for."""

from thenar.drivers.errors import ThenarError


class FirmwareError(ThenarError, ValueError):
    """What was asked for cannot be made: tables that do not fit, a board that lacks a switch, an unknown part."""
