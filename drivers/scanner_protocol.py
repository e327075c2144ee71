"""The protocol of the switch-scanner board: frames, and what they carry; docs/reference/devices.md draws every byte.

A frame is type | sequence | payload | CRC-16, stuffed by COBS, ended by 00. COBS (Cheshire and Baker 1999) costs one
byte a frame and leaves no zero inside it, so every 00 is an end, after any loss. The CRC is CRC-16/CCITT-FALSE
(polynomial 1021, start FFFF), high byte first: over a whole frame it comes out as 0. It catches every damage that stays
within 16 bits of the frame. A damaged byte of the stuffing moves zeros about, which may be more than that: of such
damages one in 65536 passes.

Integers are little-endian. A frame whose payload is not exactly what its kind asks for raises `MessageError`, and
nothing else does. Times are the board's microseconds, modulo 2**32; sets of switches are one integer, bit k for key k.

Version 2 is version 1 with analog channels: CHANNELS, ANALOG and SET_CHANNELS. A board of version 2 says so by a flag
of its HELLO, and sends none of the new frames before it is asked to: a host of version 1 reads its keys as ever. So
it is with SEGMENT and SET_SEGMENTS, of a board that follows segments.
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

# What one COBS block holds, less type, sequence and CRC. A frame on the wire is its payload and OVERHEAD bytes more.
MAX_PAYLOAD = 250
OVERHEAD = 6
_SHORTEST = 4
PROTOCOL = 1
# What a HEARTBEAT carries besides its bitmap, and so how many keys a board can have.
_TIME = Struct("<I")
MOST_KEYS = 8 * (MAX_PAYLOAD - _TIME.size)
# Flags of HELLO: keys stand in a matrix without diodes, where three closed corners of a rectangle close the fourth; and
# the board speaks version 2, since it has analog channels; it follows segments.
WITHOUT_DIODES, ANALOG, SEGMENTS = 0x01, 0x02, 0x04
ANALOG_VERSION = 2
# Codes of channels in one ANALOG; the code of a channel that could not be read, and so the most bits of a code.
MOST_ASKED, MOST_CHANNELS = 122, 255
UNREAD, MOST_BITS = 0xFFFF, 15
# What GRASP says where nothing can be known, and SEGMENT where nothing is held; the states of a SEGMENT.
NO_GRASP = 255
STATES = ("none", "forming", "held", "releasing")
# Flags of GRASP: an input was missing; the scan ended as soon as the rest of the switches could not matter.
DEGRADED, EARLY = 0x01, 0x02


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame: its kind, its number modulo 256, and what it carries."""

    kind: int
    sequence: int
    payload: bytes


@dataclass(slots=True)
class FrameCounts:
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
class FrameDecoder:
    """Bytes in, frames out; what is none is counted, and skipped to the next 00. Nothing that comes in raises."""

    counts: FrameCounts = field(default_factory=FrameCounts)
    _pieces: Pieces = field(default_factory=lambda: Pieces(MAX_PAYLOAD + OVERHEAD - 1))

    def feed(self, chunk: bytes) -> list[Frame]:
        """Return the frames that `chunk` completes, oldest first."""
        return list(filter(None, self.received(chunk)))

    def received(self, chunk: bytes) -> list[Frame | None]:
        """Return what `chunk` completes, oldest first: a frame, or None for something that was none."""
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
    """A sound frame that does not carry what its kind asks for: another firmware, or one damage in 65536."""


def _packed(layout: Struct, values: Sequence[int]) -> bytes:
    try:
        return layout.pack(*values)
    except error as reason:
        raise SettingError(f"no frame can carry {', '.join(map(str, values))}: {reason}") from reason


class Fixed:
    """A message, a dataclass whose fields in their order are the values of `LAYOUT`."""

    __slots__ = ()
    KIND: ClassVar[int]
    LAYOUT: ClassVar[Struct]

    def payload(self) -> bytes:
        """Return what the frame carries. Raises SettingError for a value that its field cannot hold."""
        return _packed(self.LAYOUT, astuple(self))  # type: ignore[call-overload]

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message of a board of so many keys. Raises MessageError where the payload has another length."""
        if len(payload) != cls.LAYOUT.size:
            raise MessageError(f"a {cls.__name__} carries {cls.LAYOUT.size} bytes, not {len(payload)}")
        return cls(*cls.LAYOUT.unpack(payload))


def from_bitmap(payload: bytes, keys: int) -> int:
    """Return which of so many keys are set. Raises MessageError at another length, or where others are set."""
    if len(payload) != (keys + 7) // 8:
        raise MessageError(f"a bitmap of {len(payload)} bytes from a board of {keys} keys")
    bits = int.from_bytes(payload, "little")
    if bits >> keys:
        raise MessageError(f"a bitmap holds key {bits.bit_length() - 1} of a board of {keys} keys")
    return bits


@dataclass(frozen=True, slots=True)
class Hello(Fixed):
    """What the board is, and how it works now: sent at boot, and in answer to PING, SET_RATE and SET_DEBOUNCE.

    token         that of the PING it answers, 0 where it answers none
    flags         WITHOUT_DIODES, ANALOG, SEGMENTS
    board         a number of this very board's own
    major, minor, patch  version of its firmware
    rows, columns key k stands at row k // columns, column k % columns; directly wired keys are one row
    scan_us       from scan to scan
    state_us      from STATE to STATE; 0: it sends an EVENT for every change instead
    heartbeat_us  from HEARTBEAT to HEARTBEAT; 0: none
    press_us, release_us  its own debouncing: presses at once and then locked, releases deferred; 0: none
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
        """How many keys the board scans."""
        return self.rows * self.columns

    @property
    def has_analog(self) -> bool:
        """Whether the board has analog channels: it speaks version 2."""
        return bool(self.flags & ANALOG)

    @property
    def has_segments(self) -> bool:
        """Whether the board follows segments, and sends them once it is asked to."""
        return bool(self.flags & SEGMENTS)

    @property
    def identity(self) -> tuple[int, int, int, int]:
        """What stays as it is while a board runs: its number, its flags, its rows and columns."""
        return self.board, self.flags, self.rows, self.columns

    @property
    def period_us(self) -> int:
        """How long the board is silent at most while all is well; 0: without limit."""
        return min((period for period in (self.state_us, self.heartbeat_us) if period), default=0)

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message. Raises MessageError where length, protocol or number of keys are none of ours."""
        if payload and payload[0] != PROTOCOL:
            raise MessageError(
                f"the board speaks protocol {payload[0]}, this is {PROTOCOL}: update the older of the two"
            )
        hello = super(Hello, cls).read(payload)
        if not 1 <= hello.keys <= MOST_KEYS:
            raise MessageError(f"a board of {hello.rows} x {hello.columns} keys: there are 1 to {MOST_KEYS}")
        return hello


class _Bitmap:
    """A message, a dataclass of the values of `LAYOUT`, of a set of keys, and of how many keys there are."""

    __slots__ = ()
    KIND: ClassVar[int]
    LAYOUT: ClassVar[Struct] = Struct("<")

    def payload(self) -> bytes:
        """Return what the frame carries: key k is bit k % 8 of byte k // 8.

        Raises OverflowError where the set holds a key that there is not, SettingError where a value does not fit.
        """
        *values, held, keys = astuple(self)  # type: ignore[call-overload]
        bitmap: bytes = held.to_bytes((keys + 7) // 8, "little")
        return _packed(self.LAYOUT, values) + bitmap

    @classmethod
    def read(cls, payload: bytes, keys: int) -> Self:
        """Return the message of a board of so many keys. Raises MessageError."""
        size = cls.LAYOUT.size
        if len(payload) < size:
            raise MessageError(f"a {cls.__name__} of {len(payload)} bytes has no room for its time")
        return cls(*cls.LAYOUT.unpack_from(payload), from_bitmap(payload[size:], keys), keys)  # type: ignore[call-arg]


@dataclass(frozen=True, slots=True)
class State(_Bitmap):
    """All keys as they were scanned just before it was sent."""

    KIND: ClassVar[int] = STATE

    closed: int
    keys: int


@dataclass(frozen=True, slots=True)
class Heartbeat(_Bitmap):
    """All keys, and when they were scanned: sent even if nothing happens, so that a lost EVENT heals."""

    KIND: ClassVar[int] = 0x04
    LAYOUT: ClassVar[Struct] = _TIME

    time_us: int
    closed: int
    keys: int


@dataclass(frozen=True, slots=True)
class Event(Fixed):
    """One key closed (edge 1) or opened (edge 0), and when it was scanned."""

    KIND: ClassVar[int] = 0x03
    LAYOUT: ClassVar[Struct] = Struct("<IHB")

    time_us: int
    key: int
    edge: int

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message of a board of so many keys. Raises MessageError."""
        event = super(Event, cls).read(payload)
        if event.key >= keys or event.edge > 1:
            raise MessageError(f"an EVENT of key {event.key}, edge {event.edge}, from a board of {keys} keys")
        return event


@dataclass(frozen=True, slots=True)
class Faults(Fixed):
    """What went wrong on the board since boot: sent when a count has grown, at most once a second. The ERROR frame.

    overruns  scans that began late       refused  frames from the host that were damaged or not understood
    dropped   frames that were never sent   bus    transactions with port expanders that failed
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
    """What a board that carries a build recognised.

    time_us  when the frame was read
    grasp    number of the grasp type in the build's order, the one after the last: nothing is held; NO_GRASP: not known
    margin   the best score less the second, in steps of the build's tables; 65535 stands for more, too
    flags    DEGRADED, EARLY
    """

    KIND: ClassVar[int] = 0x06
    LAYOUT: ClassVar[Struct] = Struct("<IBHB")

    time_us: int
    grasp: int
    margin: int
    flags: int


@dataclass(frozen=True, slots=True)
class Segment(Fixed):
    """The segment that a board which carries a build is in.

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
    """The keys that cannot be read now: sent when they change, and right before every HEARTBEAT while there are any."""

    KIND: ClassVar[int] = 0x07

    lost: int
    keys: int


@dataclass(frozen=True, slots=True)
class Channels(_Bitmap):
    """What a board of version 2 measures: sent in answer to SET_CHANNELS.

    version    2                          token   that of the SET_CHANNELS it answers
    bits       of a code, at most 15      analog_us  from ANALOG to ANALOG; 0: none is sent
    wanted     the channels whose codes an ANALOG holds, of `channels` that there are
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
        """Return what the frame carries. Raises OverflowError where the set holds a channel that there is not."""
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
    """The codes of the channels that were asked for, the lowest channel first; UNREAD for one that could not be read.

    time_us  when the last of them was converted    token  that of the SET_CHANNELS that asked for them
    """

    KIND: ClassVar[int] = 0x09
    LAYOUT: ClassVar[Struct] = Struct("<IB")

    time_us: int
    token: int
    codes: tuple[int, ...]

    def payload(self) -> bytes:
        """Return what the frame carries."""
        return self.LAYOUT.pack(self.time_us, self.token) + Struct(f"<{len(self.codes)}H").pack(*self.codes)

    @classmethod
    def read(cls, payload: bytes, keys: int = 0) -> Self:
        """Return the message. Raises MessageError where the payload is of no whole number of codes."""
        size = cls.LAYOUT.size
        if len(payload) < size or (len(payload) - size) % 2:
            raise MessageError(f"an Analog of {len(payload)} bytes holds no whole number of codes")
        time_us, token = cls.LAYOUT.unpack_from(payload)
        return cls(time_us, token, Struct(f"<{(len(payload) - size) // 2}H").unpack(payload[size:]))


@dataclass(frozen=True, slots=True)
class SetRate(Fixed):
    """How often to scan and to send, as in Hello; the Hello that answers says what the board made of it."""

    KIND: ClassVar[int] = 0x11
    LAYOUT: ClassVar[Struct] = Struct("<III")

    scan_us: int
    state_us: int
    heartbeat_us: int


@dataclass(frozen=True, slots=True)
class SetDebounce(Fixed):
    """How the board shall debounce, as in Hello."""

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
    """Send the codes of these channels, and no others, every `analog_us`; the CHANNELS that answers says what the board
    made of it. Of more than MOST_ASKED channels it takes the lowest. `room` is how many the bitmap has room for.
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
    """Send a SEGMENT now, and where `wanted` is not 0, one for every change from now on and after every HEARTBEAT."""

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
    """Return what a board of so many keys says. Raises MessageError."""
    kind = _FROM_BOARD.get(received.kind)
    if kind is None:
        raise MessageError(f"no message of a scanner board has kind 0x{received.kind:02X}")
    return kind.read(received.payload, keys)


def to_board(received: Frame) -> ToBoard:
    """Return what a host asks for. Raises MessageError."""
    kind = _TO_BOARD.get(received.kind)
    if kind is None:
        raise MessageError(f"no message to a scanner board has kind 0x{received.kind:02X}")
    return kind.read(received.payload, 0)
