"""Keys of a matrix without diodes of which nobody can say whether they are closed."""

from itertools import combinations

Mask = int


def ambiguous(closed: Mask, rows: int, columns: int) -> Mask:
    """Return the keys, bits row * columns + column, that read closed but may be ghosts of others.

    Current finds a way through three closed corners of a rectangle and closes the fourth for the reader; which of the
    four is the ghost cannot be seen. Where two rows have two columns or more in common, all of those are doubtful. What
    reads open is open.
    """
    row = (1 << columns) - 1
    held = [(shift, closed >> shift & row) for shift in range(0, rows * columns, columns)]
    crowded = [(shift, bits) for shift, bits in held if bits & (bits - 1)]
    doubtful = 0
    for (one, bits), (other, others) in combinations(crowded, 2):
        common = bits & others
        if common & (common - 1):
            doubtful |= common << one | common << other
    return doubtful
