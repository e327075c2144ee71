"""Frames of the switch-scanner board: type | sequence | payload | CRC-16, stuffed by COBS, ended by 00.

COBS (Cheshire and Baker 1999) costs one byte a frame and leaves no zero inside it, so every 00 is an end, after any
loss. The CRC is CRC-16/CCITT-FALSE (polynomial 1021, start FFFF), high byte first: over a whole frame it comes out as
0. It catches every damage that stays within 16 bits of the frame. A damaged byte of the stuffing moves zeros about,
which may be more than that: of such damages one in 65536 passes.
"""

from binascii import crc_hqx
from dataclasses import dataclass, field

import numpy as np
from cobs import cobs
from numpy.typing import NDArray

from .pieces import Pieces

Bits = NDArray[np.bool_]
Bytes = NDArray[np.uint8]

# The full bitmap of the switches: switch k is bit k % 8 of payload byte k // 8.
STATE = 0x02

# What one COBS block holds, less type, sequence and CRC. A frame on the wire is its payload and OVERHEAD bytes more.
MAX_PAYLOAD = 250
OVERHEAD = 6
_SHORTEST = 4


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame: its kind, its number modulo 256, and what it carries."""

    kind: int
    sequence: int
    payload: bytes


@dataclass(slots=True)
class Counts:
    """What came in: good frames; damaged ones (stuffing or CRC wrong), too short ones, too long ones."""

    frames: int = 0
    damaged: int = 0
    short: int = 0
    overlong: int = 0


def encode(frame: Frame) -> bytes:
    """Return the frame as it goes on the wire, its end included. Raises ValueError above MAX_PAYLOAD."""
    if len(frame.payload) > MAX_PAYLOAD:
        raise ValueError(f"a scanner frame carries at most {MAX_PAYLOAD} bytes, not {len(frame.payload)}")
    body = bytes((frame.kind, frame.sequence)) + frame.payload
    return bytes(cobs.encode(body + crc_hqx(body, 0xFFFF).to_bytes(2, "big"))) + b"\0"


@dataclass(slots=True)
class Decoder:
    """Bytes in, frames out; what is not a frame is counted and skipped to the next 00. Nothing that comes in raises."""

    counts: Counts = field(default_factory=Counts)
    _pieces: Pieces = field(default_factory=lambda: Pieces(MAX_PAYLOAD + OVERHEAD - 1))

    def feed(self, chunk: bytes) -> list[Frame]:
        """Return the frames that `chunk` completes, oldest first."""
        found = (self._frame(piece) for piece in self._pieces.feed(chunk) if piece)
        return [frame for frame in found if frame is not None]

    def _frame(self, piece: bytes) -> Frame | None:
        if len(piece) >= MAX_PAYLOAD + OVERHEAD:
            self.counts.overlong += 1
            return None
        try:
            body = bytes(cobs.decode(piece))
        except cobs.DecodeError:
            self.counts.damaged += 1
            return None
        if len(body) < _SHORTEST:
            self.counts.short += 1
            return None
        if crc_hqx(body, 0xFFFF):
            self.counts.damaged += 1
            return None
        self.counts.frames += 1
        return Frame(body[0], body[1], body[2:-2])


def pack_bits(bits: Bits) -> Bytes:
    """Return the payloads (..., ceil(s / 8)) of STATE frames for bits (..., s)."""
    return np.packbits(bits, axis=-1, bitorder="little")


def unpack_bits(payloads: Bytes, switches: int) -> Bits:
    """Return the bits (..., switches) of payloads (..., ceil(switches / 8))."""
    return np.unpackbits(payloads, axis=-1, count=switches, bitorder="little").view(np.bool_)
