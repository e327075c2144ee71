"""The root of every error that a user can cause or meet.

It lives in `drivers` because that is the lowest room of the house: everybody may import it, and it imports nobody.
Leaves derive from `ThenarError` and from the nearest builtin, so that `except ValueError` keeps working.
"""


class ThenarError(Exception):
    """Something the user can mend. The message says what was wrong, where, and what to do; the command exits with 2."""


class DeviceError(ThenarError, OSError):
    """A device cannot be opened, is gone, or does not answer as it must. Closing and opening it again may help."""


class SettingError(ThenarError, ValueError):
    """Something that a device cannot do was asked of it: no other try will help."""
