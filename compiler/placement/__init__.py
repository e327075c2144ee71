"""Which switches to keep: ID3 with pruning, as the paper does it, and baselines to compare it with."""

from thenar.drivers.errors import ThenarError


class PlacementError(ThenarError, ValueError):
    """Inputs, labels or a stored tree from which no placement can be made."""
