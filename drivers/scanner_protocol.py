"""The protocol of the switch-scanner board: frames and messages. docs/reference/devices.md has the byte layout.

A frame is type | sequence | payload | CRC-16, stuffed by COBS, ended by 00. COBS (Cheshire and Baker 1999) costs one
byte a frame and leaves no zero inside it, so every 00 is an end, after any loss. The CRC is CRC-16/CCITT-FALSE
(polynomial 1021, start FFFF), high byte first, so the CRC of a whole frame is 0. It detects all damage within 16
consecutive bits of the frame. A damaged stuffing byte may move zeros over a longer range: of such frames one in 65536
passes.

Integers are little-endian. Only a frame whose payload does not match its kind raises `MessageError`. Times are the
board's microseconds, modulo 2**32; a set of switches is one integer, bit k for key k.

Version 2 is version 1 with analog channels: CHANNELS, ANALOG and SET_CHANNELS. A board of version 2 sets a flag in its
HELLO, and sends none of the new frames before it is requested to, so a host of version 1 still reads its keys. The same
applies to SEGMENT and SET_SEGMENTS of a board that follows segments.
"""

from binascii import crc_hqx
from collections.abc import Sequence
from dataclasses import astuple, dataclass, field
from struct import Struct, error
from typing import ClassVar, Self

import numpy as np
from cobs import cobs
from numpy.typing import NDArray

from .errors import DeviceError, SettingError
from .serial_line import Pieces

Mask = int
Bits = NDArray[np.bool_]
Bytes = NDArray[np.uint8]

# The full bitmap of the switches: switch k is bit k % 8 of payload byte k // 8.
STATE = 0x02

# The capacity of one COBS block minus type, sequence and CRC. A frame on the wire is its payload plus OVERHEAD bytes.
MAX_PAYLOAD = 250
OVERHEAD = 6
_SHORTEST = 4
PROTOCOL = 1
# A HEARTBEAT carries a time and a bitmap, which limits the number of keys of a board.
_TIME = Struct("<I")
MOST_KEYS = 8 * (MAX_PAYLOAD - _TIME.size)
# Flags of HELLO: keys in a matrix without diodes, where three closed corners of a rectangle close the fourth; analog
# channels (version 2); segments.
WITHOUT_DIODES, ANALOG, SEGMENTS = 0x01, 0x02, 0x04
ANALOG_VERSION = 2
# Limits on the channels of an ANALOG and of a board; the code of an unreadable channel, which limits the bits.
MOST_ASKED, MOST_CHANNELS = 122, 255
UNREAD, MOST_BITS = 0xFFFF, 15
# The grasp number in GRASP if it is unknown, and in SEGMENT if nothing is held; the states of a SEGMENT.
NO_GRASP = 255
STATES = ("none", "forming", "held", "releasing")
# Flag of GRASP: an input was missing.
DEGRADED = 0x01


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame: its kind, its number modulo 256, and its payload."""

    kind: int
    sequence: int
    payload: bytes


@dataclass(slots=True)
class FrameCounts:
    """Counts of received frames: valid, damaged (stuffing or CRC wrong), too short, too long."""

    frames: int = 0
    damaged: int = 0
    short: int = 0
    overlong: int = 0


def encode(frame: Frame) -> bytes:
    """Return the frame's bytes on the wire, with its end. Raises ValueError above MAX_PAYLOAD."""
    if len(frame.payload) > MAX_PAYLOAD:
        raise ValueError(f"a scanner frame carries at most {MAX_PAYLOAD} bytes, not {len(frame.payload)}")
    body = bytes((frame.kind, frame.sequence)) + frame.payload
    return bytes(cobs.encode(body + crc_hqx(body, 0xFFFF).to_bytes(2, "big"))) + b"\0"


@dataclass(slots=True)
class FrameDecoder:
    """Decodes bytes to frames; other bytes are counted and skipped to the next 00. No input raises."""

    counts: FrameCounts = field(default_factory=FrameCounts)
    _pieces: Pieces = field(default_factory=lambda: Pieces(MAX_PAYLOAD + OVERHEAD - 1))

    def feed(self, chunk: bytes) -> list[Frame]:
        """Return the frames that `chunk` completes, oldest first."""
        return list(filter(None, self.received(chunk)))

    def received(self, chunk: bytes) -> list[Frame | None]:
        """Return the pieces that `chunk` completes, oldest first: a frame, or None for an invalid piece."""
        return [self._frame(piece) for piece in self._pieces.feed(chunk) if piece]

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


class MessageError(DeviceError):
    """A valid frame with a payload that does not match its kind: other firmware, or one damaged frame in 65536."""


def _packed(layout: Struct, values: Sequence[int]) -> bytes:
    try:
        return layout.pack(*values)
    except error as reason:
        raise SettingError(f"no frame can carry {', '.join(map(str, values))}: {reason}") from reason


class Fixed:
    """A message: a dataclass whose fields, in order, are the values of `LAYOUT`."""

    __slots__ = ()
    KIND: ClassVar[int]
    LAYOUT: ClassVar[Struct]

    def payload(self) -> bytes:
        """Return the payload. Raises SettingError for a value that its field cannot hold."""
        return _packed(self.LAYOUT, astuple(self))  # type: ignore[call-overload]

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message of a board with `keys` keys. Raises MessageError if the payload has another length."""
        if len(payload) != cls.LAYOUT.size:
            raise MessageError(f"a {cls.__name__} carries {cls.LAYOUT.size} bytes, not {len(payload)}")
        return cls(*cls.LAYOUT.unpack(payload))


def from_bitmap(payload: bytes, keys: int) -> int:
    """Return the set bits of a bitmap of `keys` keys. Raises MessageError for a wrong length or other set bits."""
    if len(payload) != (keys + 7) // 8:
        raise MessageError(f"a bitmap of {len(payload)} bytes from a board of {keys} keys")
    bits = int.from_bytes(payload, "little")
    if bits >> keys:
        raise MessageError(f"a bitmap holds key {bits.bit_length() - 1} of a board of {keys} keys")
    return bits


@dataclass(frozen=True, slots=True)
class Hello(Fixed):
    """The board's identity and settings: sent at boot, and in reply to PING, SET_RATE and SET_DEBOUNCE.

    token         that of the PING to which it replies, or 0
    flags         WITHOUT_DIODES, ANALOG, SEGMENTS
    board         a unique number of the board
    major, minor, patch  version of its firmware
    rows, columns key k is at row k // columns, column k % columns; directly wired keys are one row
    scan_us       period of scans
    state_us      period of STATE; 0: it sends an EVENT for every change instead
    heartbeat_us  period of HEARTBEAT; 0: none
    press_us, release_us  debouncing on the board: presses at once and then locked, releases deferred; 0: none
    time_us       when it was sent
    """

    KIND: ClassVar[int] = 0x01
    LAYOUT: ClassVar[Struct] = Struct("<BBHIBBBHHIIIHHI")

    protocol: int
    flags: int
    token: int
    board: int
    major: int
    minor: int
    patch: int
    rows: int
    columns: int
    scan_us: int
    state_us: int
    heartbeat_us: int
    press_us: int
    release_us: int
    time_us: int

    @property
    def keys(self) -> int:
        """Number of keys that the board scans."""
        return self.rows * self.columns

    @property
    def has_analog(self) -> bool:
        """Whether the board has analog channels, and thus version 2 of the protocol."""
        return bool(self.flags & ANALOG)

    @property
    def has_segments(self) -> bool:
        """Whether the board follows segments, and sends them on request."""
        return bool(self.flags & SEGMENTS)

    @property
    def identity(self) -> tuple[int, int, int, int]:
        """The constants of a board: its number, its flags, its rows and columns."""
        return self.board, self.flags, self.rows, self.columns

    @property
    def period_us(self) -> int:
        """The longest silence of a working board; 0: no limit."""
        return min((period for period in (self.state_us, self.heartbeat_us) if period), default=0)

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message. Raises MessageError for an unsupported length, protocol or number of keys."""
        if payload and payload[0] != PROTOCOL:
            raise MessageError(
                f"the board speaks protocol {payload[0]}, this is {PROTOCOL}: update the older of the two"
            )
        hello = super(Hello, cls).read(payload)
        if not 1 <= hello.keys <= MOST_KEYS:
            raise MessageError(f"a board of {hello.rows} x {hello.columns} keys: there are 1 to {MOST_KEYS}")
        return hello


class _Bitmap:
    """A message: a dataclass of the values of `LAYOUT`, a set of keys, and the number of keys."""

    __slots__ = ()
    KIND: ClassVar[int]
    LAYOUT: ClassVar[Struct] = Struct("<")

    def payload(self) -> bytes:
        """Return the payload: key k is bit k % 8 of byte k // 8.

        Raises OverflowError if the set holds a key that does not exist, SettingError if a value does not fit.
        """
        *values, held, keys = astuple(self)  # type: ignore[call-overload]
        bitmap: bytes = held.to_bytes((keys + 7) // 8, "little")
        return _packed(self.LAYOUT, values) + bitmap

    @classmethod
    def read(cls, payload: bytes, keys: int) -> Self:
        """Return the message of a board with `keys` keys. Raises MessageError."""
        size = cls.LAYOUT.size
        if len(payload) < size:
            raise MessageError(f"a {cls.__name__} of {len(payload)} bytes has no room for its time")
        return cls(*cls.LAYOUT.unpack_from(payload), from_bitmap(payload[size:], keys), keys)  # type: ignore[call-arg]


@dataclass(frozen=True, slots=True)
class State(_Bitmap):
    """All keys as scanned just before sending."""

    KIND: ClassVar[int] = STATE

    closed: int
    keys: int


@dataclass(frozen=True, slots=True)
class Heartbeat(_Bitmap):
    """All keys and the time of their scan: sent even without changes, to recover from a lost EVENT."""

    KIND: ClassVar[int] = 0x04
    LAYOUT: ClassVar[Struct] = _TIME

    time_us: int
    closed: int
    keys: int


@dataclass(frozen=True, slots=True)
class Event(Fixed):
    """One key closed (edge 1) or opened (edge 0), and the time of the scan."""

    KIND: ClassVar[int] = 0x03
    LAYOUT: ClassVar[Struct] = Struct("<IHB")

    time_us: int
    key: int
    edge: int

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message of a board with `keys` keys. Raises MessageError."""
        event = super(Event, cls).read(payload)
        if event.key >= keys or event.edge > 1:
            raise MessageError(f"an EVENT of key {event.key}, edge {event.edge}, from a board of {keys} keys")
        return event


@dataclass(frozen=True, slots=True)
class Faults(Fixed):
    """Fault counts of the board since boot: sent when a count has grown, at most once a second. The ERROR frame.

    overruns  scans that began late       refused  frames from the host that were damaged or not understood
    dropped   frames that were never sent   bus    failed transactions with port expanders
    """

    KIND: ClassVar[int] = 0x05
    LAYOUT: ClassVar[Struct] = Struct("<IIIII")

    time_us: int
    overruns: int
    refused: int
    dropped: int
    bus: int


@dataclass(frozen=True, slots=True)
class Grasp(Fixed):
    """The prediction of a board that carries a build.

    time_us  when the frame was read
    grasp    number of the grasp type in the build's order; the one after the last: nothing is held; NO_GRASP: unknown
    margin   the best score minus the second, in steps of the build's tables, clipped to 65535
    flags    DEGRADED
    """

    KIND: ClassVar[int] = 0x06
    LAYOUT: ClassVar[Struct] = Struct("<IBHB")

    time_us: int
    grasp: int
    margin: int
    flags: int


@dataclass(frozen=True, slots=True)
class Segment(Fixed):
    """The current segment of a board that carries a build.

    time_us  when its last frame was read     number  of grasps so far, modulo 65536
    grasp    number of the segment's grasp type; NO_GRASP in the state "none"
    state    a place in STATES
    """

    KIND: ClassVar[int] = 0x0A
    LAYOUT: ClassVar[Struct] = Struct("<IHBB")

    time_us: int
    number: int
    grasp: int
    state: int

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message. Raises MessageError."""
        segment = super(Segment, cls).read(payload)
        if segment.state >= len(STATES):
            raise MessageError(f"a SEGMENT of state {segment.state}: there are 0 to {len(STATES) - 1}")
        return segment


@dataclass(frozen=True, slots=True)
class Lost(_Bitmap):
    """The keys that cannot be read: sent when they change, and right before every HEARTBEAT while there are any."""

    KIND: ClassVar[int] = 0x07

    lost: int
    keys: int


@dataclass(frozen=True, slots=True)
class Channels(_Bitmap):
    """The measured channels of a board of version 2: sent in reply to SET_CHANNELS.

    version    2                          token   that of the SET_CHANNELS to which it replies
    bits       of a code, at most 15      analog_us  period of ANALOG; 0: none is sent
    wanted     the channels whose codes an ANALOG holds, out of `channels`
    """

    KIND: ClassVar[int] = 0x08
    LAYOUT: ClassVar[Struct] = Struct("<BBBIB")

    version: int
    token: int
    bits: int
    analog_us: int
    wanted: int
    channels: int

    def payload(self) -> bytes:
        """Return the payload. Raises OverflowError if the set holds a channel that does not exist."""
        head = (self.version, self.token, self.bits, self.analog_us, self.channels)
        return self.LAYOUT.pack(*head) + self.wanted.to_bytes((self.channels + 7) // 8, "little")

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message. Raises MessageError."""
        size = cls.LAYOUT.size
        if len(payload) < size:
            raise MessageError(f"a Channels of {len(payload)} bytes has no room for its fields")
        version, token, bits, analog_us, channels = cls.LAYOUT.unpack_from(payload)
        if not 1 <= bits <= MOST_BITS:
            raise MessageError(f"codes of {bits} bits: there are 1 to {MOST_BITS}")
        wanted = from_bitmap(payload[size:], channels)
        if wanted.bit_count() > MOST_ASKED:
            raise MessageError(f"{wanted.bit_count()} channels in an ANALOG: it has room for {MOST_ASKED}")
        return cls(version, token, bits, analog_us, wanted, channels)


@dataclass(frozen=True, slots=True)
class Analog:
    """The codes of the requested channels, the lowest channel first; UNREAD for one that could not be read.

    time_us  when the last of them was converted    token  that of the SET_CHANNELS that requested them
    """

    KIND: ClassVar[int] = 0x09
    LAYOUT: ClassVar[Struct] = Struct("<IB")

    time_us: int
    token: int
    codes: tuple[int, ...]

    def payload(self) -> bytes:
        """Return the payload."""
        return self.LAYOUT.pack(self.time_us, self.token) + Struct(f"<{len(self.codes)}H").pack(*self.codes)

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message. Raises MessageError if the payload is not a whole number of codes."""
        size = cls.LAYOUT.size
        if len(payload) < size or (len(payload) - size) % 2:
            raise MessageError(f"an Analog of {len(payload)} bytes holds no whole number of codes")
        time_us, token = cls.LAYOUT.unpack_from(payload)
        return cls(time_us, token, Struct(f"<{(len(payload) - size) // 2}H").unpack(payload[size:]))


@dataclass(frozen=True, slots=True)
class SetRate(Fixed):
    """Set the periods of scanning and sending, as in Hello; the Hello in reply has the accepted values."""

    KIND: ClassVar[int] = 0x11
    LAYOUT: ClassVar[Struct] = Struct("<III")

    scan_us: int
    state_us: int
    heartbeat_us: int


@dataclass(frozen=True, slots=True)
class SetDebounce(Fixed):
    """Set the debouncing on the board, as in Hello."""

    KIND: ClassVar[int] = 0x12
    LAYOUT: ClassVar[Struct] = Struct("<HH")

    press_us: int
    release_us: int


@dataclass(frozen=True, slots=True)
class GetState(Fixed):
    """Send a HEARTBEAT now."""

    KIND: ClassVar[int] = 0x13
    LAYOUT: ClassVar[Struct] = Struct("<")


@dataclass(frozen=True, slots=True)
class Ping(Fixed):
    """Send a HELLO now, with this token (1 to 65535)."""

    KIND: ClassVar[int] = 0x14
    LAYOUT: ClassVar[Struct] = Struct("<H")

    token: int


@dataclass(frozen=True, slots=True)
class SetChannels(_Bitmap):
    """Send the codes of only these channels every `analog_us`; the CHANNELS in reply has the accepted values.

    Of more than MOST_ASKED channels the board takes the lowest. `room` is the capacity of the bitmap.
    """

    KIND: ClassVar[int] = 0x15
    LAYOUT: ClassVar[Struct] = Struct("<BI")

    token: int
    analog_us: int
    wanted: int
    room: int

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message. Raises MessageError."""
        return super(SetChannels, cls).read(payload, 8 * max(0, len(payload) - cls.LAYOUT.size))


@dataclass(frozen=True, slots=True)
class SetSegments(Fixed):
    """Send a SEGMENT now and, if `wanted` is not 0, one for every change from now on and after every HEARTBEAT."""

    KIND: ClassVar[int] = 0x16
    LAYOUT: ClassVar[Struct] = Struct("<B")

    wanted: int


FromBoard = Hello | State | Heartbeat | Event | Faults | Grasp | Segment | Lost | Channels | Analog
ToBoard = SetRate | SetDebounce | GetState | Ping | SetChannels | SetSegments
_FROM_BOARD: dict[int, type[FromBoard]] = {
    kind.KIND: kind for kind in (Hello, State, Heartbeat, Event, Faults, Grasp, Segment, Lost, Channels, Analog)
}
_TO_BOARD: dict[int, type[ToBoard]] = {
    kind.KIND: kind for kind in (SetRate, SetDebounce, GetState, Ping, SetChannels, SetSegments)
}


def frame(message: FromBoard | ToBoard, sequence: int) -> Frame:
    """Return the frame of a message, with its number modulo 256."""
    return Frame(message.KIND, sequence & 0xFF, message.payload())


def from_board(received: Frame, keys: int) -> FromBoard:
    """Return the message of a board with `keys` keys. Raises MessageError."""
    kind = _FROM_BOARD.get(received.kind)
    if kind is None:
        raise MessageError(f"no message of a scanner board has kind 0x{received.kind:02X}")
    return kind.read(received.payload, keys)


def to_board(received: Frame) -> ToBoard:
    """Return the message of a host. Raises MessageError."""
    kind = _TO_BOARD.get(received.kind)
    if kind is None:
        raise MessageError(f"no message to a scanner board has kind 0x{received.kind:02X}")
    return kind.read(received.payload, 0)
