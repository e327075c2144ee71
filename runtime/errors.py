"""Errors between a build folder, a glove, a recording and a recognised grasp."""

from thenar.drivers.errors import ThenarError

__all__ = ["BuildError", "FormatError", "FrameError", "HarnessError", "ThenarError"]


class FormatError(ThenarError, ValueError):
    """A file is foreign, truncated, altered, oversized or of a newer format.

    The message names the file, and of a recording also the byte.
    """


class BuildError(ThenarError, ValueError):
    """A build folder cannot be used as it is."""


class FrameError(ThenarError, ValueError):
    """A frame does not fit the build: wrong number of switches or joints, or a code outside its range."""


class HarnessError(ThenarError, ValueError):
    """A harness is invalid or does not fit the build; the message names file, line and key."""
