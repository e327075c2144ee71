"""The base class of every error that a user can cause or meet.

It is in `drivers`, the lowest layer: every package may import it, and it imports none. Subclasses derive from
`ThenarError` and from the nearest builtin, so that `except ValueError` keeps working.
"""


class ThenarError(Exception):
    """Something the user can fix. The message says what was wrong, where, and what to do; the command exits with 2."""


class DeviceError(ThenarError, OSError):
    """A device cannot be opened, is gone, or does not reply as it should. Closing and reopening it may help."""


class SettingError(ThenarError, ValueError):
    """A request that the device cannot fulfil: retrying does not help."""
