"""ROS messages whose bytes are at hand: Cyclone's serialisation in Python takes most of the time that a frame has.

The bytes come from that serialisation, once; afterwards only the numbers in them are replaced. They are CDR, as
`ros_messages` says: four bytes of header, then the fields, each aligned to its size counted from behind the header.
"""

import struct
from typing import Any

from .angles import JointAngles
from .ros_messages import Header, JointState, String, Time

_STAMP_AT = 4
_COUNTS = 8  # behind the positions: how many velocities and efforts, none each


class PackedString(String):
    """A text that is published again and again."""

    def __init__(self, data: str) -> None:
        super().__init__(data)
        self._bytes = super().serialize(use_version_2=False)

    def serialize(self, *_: Any, **__: Any) -> bytes:
        """Return the bytes."""
        return self._bytes


class PackedAngles(JointState):
    """The state of joints whose names stay the same."""

    def __init__(self, names: tuple[str, ...]) -> None:
        super().__init__(Header(Time(0, 0), ""), list(names), [0.0] * len(names), [], [])
        self.names = names
        self._bytes = bytearray(super().serialize(use_version_2=False))
        self._stamp = struct.Struct("=iI")
        self._positions = struct.Struct(f"={len(names)}d")
        self._positions_at = len(self._bytes) - _COUNTS - self._positions.size

    def set(self, unix_us: int, angles: JointAngles) -> None:
        """Take over the angles of a moment, those of the same names."""
        seconds, microseconds = divmod(unix_us, 1_000_000)
        self._stamp.pack_into(self._bytes, _STAMP_AT, seconds, microseconds * 1000)
        self._positions.pack_into(self._bytes, self._positions_at, *angles.positions_rad)

    def serialize(self, *_: Any, **__: Any) -> bytes:
        """Return the bytes."""
        return bytes(self._bytes)
