"""What can go wrong between a build and the spec of its glove."""

from thenar.drivers.errors import ThenarError


class SpecError(ThenarError, ValueError):
    """There is no glove to describe, or not with this wiring."""
