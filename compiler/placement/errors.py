"""What can be wrong with what a placement is asked for."""

from thenar.runtime.errors import ThenarError


class PlacementError(ThenarError, ValueError):
    """Inputs, labels or a stored tree from which no placement can be made."""
