"""What can be wrong with a recording."""

from thenar.drivers.errors import ThenarError


class McapError(ThenarError, ValueError):
    """A recording cannot be read: no MCAP, none of thenar's, or altered. The message names the file and the byte."""
