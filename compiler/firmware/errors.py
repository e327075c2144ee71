"""What the firmware room raises."""

from thenar.drivers.errors import ThenarError


class FirmwareError(ThenarError, ValueError):
    """What was asked for cannot be made: tables that do not fit, a board that lacks a switch, an unknown part."""
