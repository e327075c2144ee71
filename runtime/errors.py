"""What can go wrong between a build folder and a recognised grasp."""

from ..drivers.errors import ThenarError

__all__ = ["BuildError", "FrameError", "SealError", "ThenarError"]


class SealError(ThenarError, ValueError):
    """A sealed file is not what it claims to be: foreign, truncated, altered, oversized or of a newer format."""


class BuildError(ThenarError, ValueError):
    """A build folder cannot be used as it stands."""


class FrameError(ThenarError, ValueError):
    """A frame does not fit the build: wrong number of switches or joints, or a code outside its range."""
