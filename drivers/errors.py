"""The base class of every error that a user can cause or meet.

It is in `drivers`, the lowest layer: every package may import it. Subclasses derive from
`ThenarError` and from the nearest builtin, so that `except ValueError` keeps working.
"""

from .names import shown


class ThenarError(Exception):
    """Something the user can fix. The message says what was wrong, where, and what to do; the command exits with 2.

    As text, it is safe for a terminal, whatever the file holds that it quotes.
    """

    def __str__(self) -> str:
        return shown(super().__str__())


class DeviceError(ThenarError, OSError):
    """A device cannot be opened, is gone, or does not reply as it should. Closing and reopening it may help."""


class SettingError(ThenarError, ValueError):
    """An unknown name, or a request that the device cannot fulfil: retrying does not help."""
