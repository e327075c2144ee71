"""Several senders in one place: rows of one of them count, those of all others are counted and left out."""

import ipaddress
import re
from collections.abc import Hashable
from typing import NamedTuple

from .errors import SettingError
from .names import shortened

# A stream belongs to its first sender until that one has been silent for this long.
SILENCE_US = 1_000_000
# Another sender is reported until it has been silent for this long.
REPORT_US = 2_000_000
_ADDRESS = re.compile(r"(?:\[([^\]]+)\]|([^:]+)):(\d{1,5})")


class FirstSender:
    """Admits the first sender that it meets until that one stops sending, then the next that sends; or `only` one.

    current  the sender that is admitted; None before the first
    """

    def __init__(self, only: Hashable | None = None) -> None:
        self.current, self._only = only, only
        self._other: Hashable | None = None
        self._heard_us = self._other_us = 0

    def admits(self, sender: Hashable, now_us: int) -> bool:
        """Return whether what `sender` sent at this time of the monotonic clock counts."""
        silent = self.current is None or now_us - self._heard_us >= SILENCE_US
        if silent and self._only is None:
            self.current = sender
        if sender == self.current:
            self._heard_us = now_us
            return True
        self._other, self._other_us = sender, now_us
        return False

    def other(self, now_us: int) -> Hashable | None:
        """Return the last sender that was not admitted, if it still sends."""
        return self._other if now_us - self._other_us < REPORT_US else None


class Address(NamedTuple):
    """The address of a sender of datagrams; a port of None stands for all its ports."""

    host: str
    port: int | None = None

    def __str__(self) -> str:
        if self.port is None:
            return self.host
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    def covers(self, other: "Address") -> bool:
        """Return whether `other` is this address."""
        return self.host == other.host and self.port in (None, other.port)


def address_of(host: str, port: int | None = None) -> Address:
    """Return the address of an IP address as text. Raises ValueError if it is none."""
    found = ipaddress.ip_address(host)
    return Address(str(getattr(found, "ipv4_mapped", None) or found), port)


def parse_address(text: str) -> Address:
    """Return the address that is written as `192.168.4.7`, `192.168.4.7:5001`, `fe80::1` or `[fe80::1]:5001`.

    Raises SettingError if it is none.
    """
    found = _ADDRESS.fullmatch(text)
    try:
        if found is None:
            return address_of(text)
        if 0 < int(found[3]) < 65536:
            return address_of(found[1] or found[2], int(found[3]))
    except ValueError:
        pass
    raise SettingError(
        f"{shortened(repr(text))} is not the address of a sender, such as 192.168.4.7 or 192.168.4.7:5001"
    )
