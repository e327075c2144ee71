"""Errors between a build folder, a glove, a recording and a recognised grasp."""

from thenar.drivers.errors import ThenarError

__all__ = ["BuildError", "FrameError", "HarnessError", "McapError", "SealError", "ThenarError"]


class SealError(ThenarError, ValueError):
    """A sealed file is not valid: foreign, truncated, altered, oversized or of a newer format."""


class BuildError(ThenarError, ValueError):
    """A build folder cannot be used as it is."""


class FrameError(ThenarError, ValueError):
    """A frame does not fit the build: wrong number of switches or joints, or a code outside its range."""


class HarnessError(ThenarError, ValueError):
    """A harness is invalid or does not fit the build; the message names file, line and key."""


class McapError(ThenarError, ValueError):
    """A recording cannot be read: not MCAP, not from thenar, or altered. The message names the file and the byte."""
