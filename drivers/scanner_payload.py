"""What any payload of a scanner frame is read by: fields of fixed places, and bitmaps of keys. Little-endian."""

import struct
from dataclasses import astuple
from typing import ClassVar, Self

from .errors import DeviceError, SettingError


class MessageError(DeviceError):
    """A sound frame that does not carry what its kind asks for: another firmware, or one damage in 65536."""


class Fixed:
    """A message, a dataclass whose fields in their order are the values of `LAYOUT`."""

    __slots__ = ()
    KIND: ClassVar[int]
    LAYOUT: ClassVar[struct.Struct]

    def payload(self) -> bytes:
        """Return what the frame carries. Raises SettingError for a value that its field cannot hold."""
        try:
            return self.LAYOUT.pack(*astuple(self))  # type: ignore[call-overload]
        except struct.error as reason:
            raise SettingError(f"no frame can carry {self}: {reason}") from reason

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return the message. Raises MessageError unless the payload has its exact length."""
        if len(payload) != cls.LAYOUT.size:
            raise MessageError(f"a {cls.__name__} carries {cls.LAYOUT.size} bytes, not {len(payload)}")
        return cls(*cls.LAYOUT.unpack(payload))


def to_bitmap(closed: int, keys: int) -> bytes:
    """Return the bytes of `closed`: key k is bit k % 8 of byte k // 8. Raises OverflowError if they are too few."""
    return closed.to_bytes((keys + 7) // 8, "little")


def from_bitmap(payload: bytes, keys: int) -> int:
    """Return which of so many keys are set. Raises MessageError at another length, or where others are set."""
    if len(payload) != (keys + 7) // 8:
        raise MessageError(f"a bitmap of {len(payload)} bytes from a board of {keys} keys")
    bits = int.from_bytes(payload, "little")
    if bits >> keys:
        raise MessageError(f"a bitmap holds key {bits.bit_length() - 1} of a board of {keys} keys")
    return bits
