"""Sensor records of the CyberGlove's serial protocol: 'G' or 'S', one byte a sensor, NUL.

A polled record begins with G, a streamed one with S. Sensors send 1 to 255, never 0, so a NUL is an end; but G and S
are sensor values too, so a record is one only if it also has the exact length. A glove in trouble puts 'es' (asked for
records faster than it can send them) or 'eg' (glove not plugged in) before the NUL; 'e', 's' and 'g' are sensor values
as well, and only the two bytes too many tell. Time stamps and the status byte are left switched off.
(The vendor's manual, as public drivers quote it: ViSTA, FreeVR, Shadow's serial_glove.)
"""

from dataclasses import dataclass, field
from typing import Literal

from .pieces import Pieces

SENSORS = 18
# A record's length on the wire is its sensors plus these.
OVERHEAD = 2

POLLED, STREAMED = b"G", b"S"
Fault = Literal["too fast", "unplugged"]
_FAULTS: dict[bytes, Fault] = {b"es": "too fast", b"eg": "unplugged"}
_ENDINGS: dict[Fault | None, bytes] = {None: b"", **{fault: ending for ending, fault in _FAULTS.items()}}


@dataclass(frozen=True, slots=True)
class Record:
    """One reading: the sensors' bytes in wire order, streamed or polled, and what the glove complains of."""

    sensors: bytes
    streamed: bool = True
    fault: Fault | None = None


@dataclass(slots=True)
class Counts:
    """What came in: good records, those with a fault among them; pieces that were none, by what was wrong."""

    records: int = 0
    faults: int = 0
    wrong_start: int = 0
    wrong_length: int = 0


def encode(record: Record) -> bytes:
    """Return the record as it goes on the wire, its NUL included. Raises ValueError where a sensor is 0."""
    if 0 in record.sensors:
        raise ValueError(f"sensor {record.sensors.index(0)} is 0, which ends a CyberGlove record: values are 1 to 255")
    start = STREAMED if record.streamed else POLLED
    return start + record.sensors + _ENDINGS[record.fault] + b"\0"


@dataclass(slots=True)
class Decoder:
    """Bytes in, records of so many sensors out; what is none is counted and skipped to the next NUL. Nothing raises."""

    sensors: int = SENSORS
    counts: Counts = field(default_factory=Counts)
    _pieces: Pieces = field(init=False)

    def __post_init__(self) -> None:
        self._pieces = Pieces(self.sensors + 3)

    def feed(self, chunk: bytes) -> list[Record]:
        """Return the records that `chunk` completes, oldest first."""
        found = (self._record(piece) for piece in self._pieces.feed(chunk) if piece)
        return [record for record in found if record is not None]

    def _record(self, piece: bytes) -> Record | None:
        start, sensors, ending = piece[:1], piece[1 : self.sensors + 1], piece[self.sensors + 1 :]
        if start not in (POLLED, STREAMED):
            self.counts.wrong_start += 1
            return None
        fault = _FAULTS.get(ending)
        if len(sensors) < self.sensors or (ending and fault is None):
            self.counts.wrong_length += 1
            return None
        self.counts.records += 1
        self.counts.faults += fault is not None
        return Record(sensors, start == STREAMED, fault)
