"""Limits of a table that is read: within them, reading a file of n bytes takes at most 200 MB + 20 n of memory."""

LARGEST = 1_000_000_000  # bytes of a table, also when it is unpacked
# Bytes that a packed table may unpack to: a constant, and a number for each byte of its file.
UNPACKED = 6_000_000
UNPACKED_EACH = 1
LONGEST_LINE = 16_000_000  # characters
ROWS = 1_000_000
COLUMNS = 100_000
TYPES = 100_000  # grasp types, and values that an ARFF lists
# Bytes that the names of grasp types, subjects or objects may take as an array, at four a character: a constant,
# and a number for each byte of their file.
NAMES = 10_000_000
NAMES_EACH = 2


def unpacked(size: int) -> int:
    """Return how many bytes a packed table in a file of `size` bytes may unpack to."""
    return min(LARGEST, UNPACKED + UNPACKED_EACH * size)
