"""The CyberGlove's serial protocol: sensors, commands and replies, periods, records.

It follows the vendor's manual as public drivers quote it (ViSTA, FreeVR, Shadow's serial_glove, VESS, asr, toon);
docs/reference/devices.md lists their disagreements.

**Sensors.** The box has 24 slots. Two are never sent: the abduction of the index, which no glove measures, and the
last.

**Commands.** Upper-case letters are binary: their arguments and replies are bytes. A query is '?' and a letter. A reply
is an echo of the command's letters, the values, and a NUL; as values may be 0, its length determines its end. Only the
information text has a terminator, CR LF NUL. A reply may also be an error: 'e' and an error letter, with or without the
echo before it (both are understood).

**Periods.** The period is two 16-bit words; their product counts ticks of 1/115200 s at every baud rate; 0 is "as fast
as you can". One driver quotes from the vendor's SerialCommands document how fast that is: a record is digitised sensor
by sensor, then sent. This driver only warns of shorter periods.

**Records.** 'G' (polled) or 'S' (streamed), one byte a sensor, the status byte if it is on, NUL. Sensors send 1 to 255,
never 0, so a NUL is an end; but G and S are sensor values too, so a record must also have the exact length. A glove in
trouble inserts 'es' (records requested faster than it can send them) or 'eg' (glove not plugged in) before the NUL;
'e', 's' and 'g' are sensor values as well, so only the two extra bytes show the fault. The highest bit of the status
byte is always 1. Time stamps, which may hold zeros, are left switched off.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import ceil, isfinite
from typing import Literal

from .errors import SettingError
from .logs import logger
from .serial_line import sending_us

_LOG = logger(__name__)

_FINGER_SLOTS = ("mpj", "pij", "dij")
# In slot order; a mask's bit is the slot's place, the lowest bit of the first byte first. "" is never sent.
_SLOTS = (
    *("thumb_rotation", "thumb_mpj", "thumb_ij", "thumb_abduction"),
    *(f"index_{joint}" for joint in _FINGER_SLOTS),
    "",
    *(f"middle_{joint}" for joint in _FINGER_SLOTS),
    "middle_index_abduction",
    *(f"ring_{joint}" for joint in _FINGER_SLOTS),
    "ring_middle_abduction",
    *(f"little_{joint}" for joint in _FINGER_SLOTS),
    "little_ring_abduction",
    *("palm_arch", "wrist_pitch", "wrist_yaw", ""),
)

MASK_18 = bytes.fromhex("3F BB 7B")
MASK_22 = bytes.fromhex("7F FF 7F")
STOP = b"\x03"  # Ctrl-C
POLL, STREAM = b"G", b"S"  # also what their records begin with
# The reply to ?G when all is well: bit 0 initialised, bit 1 glove connected (two of seven sources swap the bits).
READY = 3
TEXT_END = b"\r\n\0"
_ERRORS = {
    b"?": "unknown command",
    b"n": "wrong number of values, or a wrong value",
    b"y": "the external synchronisation comes too fast",
    b"g": "no glove is plugged in",
    b"s": "sampling too fast",
}
# Bytes in the reply to ?X, by X; below, bytes after X as a setting. docs/reference/devices.md explains each letter.
REPLY_BYTES: Mapping[str, int] = dict.fromkeys("DFGNRSU", 1) | {"M": 3, "T": 4}
SET: Mapping[str, int] = dict.fromkeys("DFNU", 1) | {"M": 3, "T": 4}
TICKS_HZ = 115_200
DIGITISED_US = 250.0
FILTERED_US = 125.6
_WORD = 0xFFFF
Words = tuple[int, int]
FASTEST: Words = (0, 0)
SENSORS = 18
# A record's length on the wire is its sensors plus these; the status byte is one more.
OVERHEAD = 2
# Bits of the status byte: a glove is plugged into the box; always 1. Between are the wrist's switch and light.
PLUGGED, ALWAYS = 0x01, 0x80
RecordFault = Literal["too fast", "unplugged"]
_FAULTS: dict[bytes, RecordFault] = {b"es": "too fast", b"eg": "unplugged"}
_ENDINGS: dict[RecordFault | None, bytes] = {None: b"", **{fault: ending for ending, fault in _FAULTS.items()}}


def masked_sensors(mask: bytes) -> tuple[str, ...]:
    """Return the sensors that a mask of 3 bytes lets through, in wire order."""
    bits = int.from_bytes(mask, "little")
    return tuple(name for slot, name in enumerate(_SLOTS) if name and bits >> slot & 1)


def mask_of(names: Collection[str]) -> bytes:
    """Return the mask of 3 bytes that lets these sensors through."""
    return sum(1 << slot for slot, name in enumerate(_SLOTS) if name and name in names).to_bytes(3, "little")


# The order on the wire. The 18-sensor glove has no sensors on the outermost finger joints; the wrist's are always last.
SENSORS_18 = masked_sensors(MASK_18)
SENSORS_22 = masked_sensors(MASK_22)
GLOVES = {18: SENSORS_18, 22: SENSORS_22}


def sensors_with(joints: Collection[str]) -> int | None:
    """Return the sensor count of the smallest CyberGlove that measures all of `joints`; None if there is none."""
    return next((len(names) for names in GLOVES.values() if joints and set(joints) <= set(names)), None)


@dataclass(frozen=True, slots=True)
class Command:
    """A command: its bytes, the echo that begins its reply, and the number of value bytes in the reply; None: text."""

    request: bytes
    echo: bytes
    values: int | None

    @property
    def name(self) -> str:
        """The command's name in messages."""
        return self.echo.decode("ascii")


@dataclass(frozen=True, slots=True)
class Reply:
    """A reply of the box: values (or text), or an error."""

    values: bytes
    error: str | None = None


INFORMATION = Command(b"?i", b"?i", None)


def query(letter: str) -> Command:
    """Return the query ?X of a letter X. Raises SettingError if the box has none."""
    if letter not in REPLY_BYTES:
        raise SettingError(f"a CyberGlove has no query ?{letter}: it has ?{', ?'.join(sorted(REPLY_BYTES))}")
    echo = b"?" + letter.encode("ascii")
    return Command(echo, echo, REPLY_BYTES[letter])


def setting(letter: str, values: bytes) -> Command:
    """Return the command that sets X to `values`. Raises SettingError if it takes other values."""
    if len(values) != SET.get(letter):
        raise SettingError(
            f"a CyberGlove's {letter} cannot be set to {len(values)} bytes: settings are "
            + ", ".join(f"{letter} ({length})" for letter, length in sorted(SET.items()))
        )
    echo = letter.encode("ascii")
    return Command(echo + values, echo, 0)


def find_reply(command: Command, received: bytes, *, last: bool = False) -> Reply | None:
    """Return the reply among the bytes received since the command, or None if it is not complete yet.

    Bytes before it are skipped, NUL by NUL: remains of a stream, the echo of a Ctrl-C. `last` means that nothing more
    will come: then bytes that could have become a longer reply are accepted as they are.
    """
    while received:
        reply = _at_start(command, received, last)
        if reply is not None:
            return reply
        if not last and received.startswith(command.echo):
            return None
        received = received.partition(b"\0")[2]
    return None


def _at_start(command: Command, received: bytes, last: bool) -> Reply | None:
    begin, values = len(command.echo), command.values
    end = received.find(TEXT_END) if values is None else begin + values
    if received.startswith(command.echo) and end >= 0 and (values is None or received[end : end + 1] == b"\0"):
        return Reply(received[begin:end])
    found = re.match(rb"(%b)?e([?nygs])(\r\n)?\0" % re.escape(command.echo), received)
    # After the echo, apparent error bytes may be the beginning of values.
    if found is None or (found[1] and not last and values is not None and found.end() <= begin + values):
        return None
    return Reply(b"", _ERRORS[found[2]])


def period_words(rate_hz: float | None) -> Words:
    """Return the two words for the rate nearest to `rate_hz`; for None, the fastest.

    Raises SettingError if no glove can be set to such a rate.
    """
    if rate_hz is None:
        return FASTEST
    if not isfinite(rate_hz) or rate_hz <= 0.0 or TICKS_HZ / rate_hz > _WORD * _WORD:
        raise SettingError(f"a CyberGlove cannot send {rate_hz:g} records a second: request 1 to 160")
    ticks = max(1, round(TICKS_HZ / rate_hz))
    times = ceil(ticks / _WORD)
    return round(ticks / times), times


def period_us(words: Words) -> float:
    """Return the period in microseconds that the words encode; 0 for the fastest."""
    return words[0] * words[1] * 1e6 / TICKS_HZ


def digitising_us(sensors: int, filtered: bool = False) -> float:
    """Return the time in microseconds to digitise this number of sensors, with or without the digital filter."""
    return sensors * (DIGITISED_US + FILTERED_US * filtered)


def shortest_us(sensors: int, baud: int, *, status: bool = False, filtered: bool = False) -> float:
    """Return the shortest period in microseconds that the line and the box allow."""
    return digitising_us(sensors, filtered) + sending_us(sensors + OVERHEAD + status, baud)


@dataclass(frozen=True, slots=True)
class Record:
    """One reading: the sensors' bytes in wire order, a fault, the status byte.

    The sensor values of an unplugged glove are meaningless.
    """

    sensors: bytes
    fault: RecordFault | None = None
    status: int | None = None


@dataclass(slots=True)
class RecordCounts:
    """Counts of received records (including those with a fault), and of rejected pieces by reason."""

    records: int = 0
    too_fast: int = 0
    unplugged: int = 0
    wrong_start: int = 0
    wrong_length: int = 0


def encode(record: Record) -> bytes:
    """Return the streamed record's bytes, with its NUL. Raises ValueError if a sensor or the status is 0."""
    if 0 in record.sensors:
        raise ValueError(f"sensor {record.sensors.index(0)} is 0, which ends a CyberGlove record: values are 1 to 255")
    if record.status == 0:
        raise ValueError("a status byte of 0 would end the CyberGlove record: its highest bit is always 1")
    status = b"" if record.status is None else bytes([record.status])
    return STREAM + record.sensors + status + _ENDINGS[record.fault] + b"\0"


class RecordDecoder:
    """Decodes bytes to records of `sensors` sensors; other bytes are counted and skipped to the next NUL. Never raises.

    status: whether the glove appends its status byte.
    """

    def __init__(self, sensors: int = SENSORS, counts: RecordCounts | None = None, status: bool = False) -> None:
        self.counts = counts or RecordCounts()
        self._sensors, self._status, self._body = sensors, status, 1 + sensors + status
        self._rest = b""

    def feed(self, chunk: bytes) -> list[Record]:
        """Return the records that `chunk` completes, oldest first."""
        pieces = chunk.split(b"\0")
        pieces[0] = self._rest + pieces[0]
        # A byte more than any record: the length shows that it is none, and no stream without NULs fills the memory.
        self._rest = pieces.pop()[: self._body + 3]
        return [record for piece in pieces if piece and (record := self._record(piece)) is not None]

    def _record(self, piece: bytes) -> Record | None:
        ending = piece[self._body :]
        if piece[:1] not in (POLL, STREAM):
            self.counts.wrong_start += 1
            _LOG.debug("%d bytes that do not begin with G or S were skipped", len(piece))
            return None
        fault = _FAULTS.get(ending)
        if len(piece) < self._body or (ending and fault is None):
            self.counts.wrong_length += 1
            _LOG.debug("a record of %d bytes was skipped: expected %d", len(piece), self._body)
            return None
        self.counts.records += 1
        if fault is not None:
            self.counts.too_fast += fault == "too fast"
            self.counts.unplugged += fault == "unplugged"
        status = piece[self._body - 1] if self._status else None
        return Record(piece[1 : self._sensors + 1], fault, status)
