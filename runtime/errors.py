"""What can go wrong between a build folder, a glove, a recording and a recognised grasp."""

from thenar.drivers.errors import ThenarError

__all__ = ["BuildError", "FrameError", "HarnessError", "McapError", "SealError", "ThenarError"]


class SealError(ThenarError, ValueError):
    """A sealed file is not what it claims to be: foreign, truncated, altered, oversized or of a newer format."""


class BuildError(ThenarError, ValueError):
    """A build folder cannot be used as it stands."""


class FrameError(ThenarError, ValueError):
    """A frame does not fit the build: wrong number of switches or joints, or a code outside its range."""


class HarnessError(ThenarError, ValueError):
    """A harness cannot be as its file says, or does not fit the build; the message names file, line and key."""


class McapError(ThenarError, ValueError):
    """A recording cannot be read: no MCAP, none of thenar's, or altered. The message names the file and the byte."""
