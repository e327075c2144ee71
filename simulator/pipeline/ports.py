"""How switches are wired: sixteen to a port; in a matrix a port is a row, and its places are the columns."""

import numpy as np
from numpy.typing import NDArray

SIZE = 16


def count(switches: int) -> int:
    """Return how many ports so many switches need."""
    return -(-switches // SIZE)


def of(switches: int) -> NDArray[np.int64]:
    """Return the port (switches,) of each switch."""
    return np.arange(switches) // SIZE
