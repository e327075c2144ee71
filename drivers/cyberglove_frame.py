"""Sensor records of the CyberGlove's serial protocol: 'G' or 'S', one byte a sensor, the status byte if on, NUL.

A polled record begins with G, a streamed one with S. Sensors send 1 to 255, never 0, so a NUL is an end; but G and S
are sensor values too, so a record is one only if it also has the exact length. A glove in trouble puts 'es' (asked for
records faster than it can send them) or 'eg' (glove not plugged in) before the NUL; 'e', 's' and 'g' are sensor values
as well, and only the two bytes too many tell. The status byte is never 0 either: its highest bit is always 1. Time
stamps, which may hold zeros, are left switched off.
(The vendor's manual, as public drivers quote it: ViSTA, FreeVR, Shadow's serial_glove.)
"""

from dataclasses import dataclass, field
from typing import Literal

from .pieces import Pieces

SENSORS = 18
# A record's length on the wire is its sensors plus these; the status byte is one more.
OVERHEAD = 2

# Bits of the status byte: a glove is plugged into the box; the wrist's switch; the wrist's light; always 1.
PLUGGED, SWITCH, LIGHT, ALWAYS = 0x01, 0x02, 0x04, 0x80

POLLED, STREAMED = b"G", b"S"
Fault = Literal["too fast", "unplugged"]
_FAULTS: dict[bytes, Fault] = {b"es": "too fast", b"eg": "unplugged"}
_ENDINGS: dict[Fault | None, bytes] = {None: b"", **{fault: ending for ending, fault in _FAULTS.items()}}


@dataclass(frozen=True, slots=True)
class Record:
    """One reading: the sensors' bytes in wire order, streamed or polled, what the glove complains of, its status byte.

    Of a glove that is unplugged the sensors mean nothing.
    """

    sensors: bytes
    streamed: bool = True
    fault: Fault | None = None
    status: int | None = None


@dataclass(slots=True)
class Counts:
    """What came in: good records, those with a fault among them; pieces that were none, by what was wrong."""

    records: int = 0
    too_fast: int = 0
    unplugged: int = 0
    wrong_start: int = 0
    wrong_length: int = 0

    @property
    def resyncs(self) -> int:
        """How often bytes were skipped up to the next NUL."""
        return self.wrong_start + self.wrong_length


def encode(record: Record) -> bytes:
    """Return the record as it goes on the wire, its NUL included. Raises ValueError where sensor or status is 0."""
    if 0 in record.sensors:
        raise ValueError(f"sensor {record.sensors.index(0)} is 0, which ends a CyberGlove record: values are 1 to 255")
    if record.status == 0:
        raise ValueError("a status byte of 0 would end the CyberGlove record: its highest bit is always 1")
    start = STREAMED if record.streamed else POLLED
    status = b"" if record.status is None else bytes([record.status])
    return start + record.sensors + status + _ENDINGS[record.fault] + b"\0"


@dataclass(slots=True)
class Decoder:
    """Bytes in, records of so many sensors out; what is none is counted and skipped to the next NUL. Nothing raises.

    status: whether the glove was told to append its status byte.
    """

    sensors: int = SENSORS
    counts: Counts = field(default_factory=Counts)
    status: bool = False
    _pieces: Pieces = field(init=False)
    _body: int = field(init=False)

    def __post_init__(self) -> None:
        self._body = 1 + self.sensors + self.status
        self._pieces = Pieces(self._body + 2)

    def feed(self, chunk: bytes) -> list[Record]:
        """Return the records that `chunk` completes, oldest first."""
        found = (self._record(piece) for piece in self._pieces.feed(chunk) if piece)
        return [record for record in found if record is not None]

    def _record(self, piece: bytes) -> Record | None:
        start, ending = piece[:1], piece[self._body :]
        if start not in (POLLED, STREAMED):
            self.counts.wrong_start += 1
            return None
        fault = _FAULTS.get(ending)
        if len(piece) < self._body or (ending and fault is None):
            self.counts.wrong_length += 1
            return None
        self._count(fault)
        status = piece[self._body - 1] if self.status else None
        return Record(piece[1 : self.sensors + 1], start == STREAMED, fault, status)

    def _count(self, fault: Fault | None) -> None:
        self.counts.records += 1
        self.counts.too_fast += fault == "too fast"
        self.counts.unplugged += fault == "unplugged"
