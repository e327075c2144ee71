"""What the frames of the switch-scanner board carry, integers little-endian; docs/scanner-board.md draws every byte.

A frame whose payload is not exactly what its kind asks for raises `MessageError`, and nothing else does. Times are the
board's microseconds, modulo 2**32; sets of switches are one integer, bit k for key k.
"""

from dataclasses import dataclass
from struct import Struct
from typing import ClassVar, Self

from .scanner_frame import MAX_PAYLOAD, STATE, Frame
from .scanner_payload import Fixed, MessageError, from_bitmap, to_bitmap

PROTOCOL = 1
# What a HEARTBEAT carries besides its bitmap, and so how many keys a board can have.
_TIME = Struct("<I")
MOST_KEYS = 8 * (MAX_PAYLOAD - _TIME.size)

WITHOUT_DIODES = 0x01
"""Flag of HELLO: keys stand in a matrix without diodes, where three closed corners of a rectangle close the fourth."""


NO_GRASP = 255
"""What GRASP says where no grasp type was recognised."""

DEGRADED, EARLY = 0x01, 0x02
"""Flags of GRASP: an input was missing; the scan ended as soon as the rest of the switches could not matter."""


@dataclass(frozen=True, slots=True)
class Hello(Fixed):
    """What the board is, and how it works now: sent at boot, and in answer to PING, SET_RATE and SET_DEBOUNCE.

    token         that of the PING it answers, 0 where it answers none
    flags         WITHOUT_DIODES
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
    def identity(self) -> tuple[int, int, int, int]:
        """What stays as it is while a board runs: its number, its flags, its rows and columns."""
        return self.board, self.flags, self.rows, self.columns

    @property
    def period_us(self) -> int:
        """How long the board is silent at most while all is well; 0: without limit."""
        return min((period for period in (self.state_us, self.heartbeat_us) if period), default=0)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return the message. Raises MessageError where length, protocol or number of keys are none of ours."""
        if payload and payload[0] != PROTOCOL:
            raise MessageError(
                f"the board speaks protocol {payload[0]}, this is {PROTOCOL}: update the older of the two"
            )
        hello = super(Hello, cls).read(payload)
        if not 1 <= hello.keys <= MOST_KEYS:
            raise MessageError(f"a board of {hello.rows} x {hello.columns} keys: there are 1 to {MOST_KEYS}")
        return hello


@dataclass(frozen=True, slots=True)
class State:
    """All keys as they were scanned just before it was sent."""

    KIND: ClassVar[int] = STATE

    closed: int
    keys: int

    def payload(self) -> bytes:
        """Return what the frame carries. Raises OverflowError where a key is closed that there is not."""
        return to_bitmap(self.closed, self.keys)

    @classmethod
    def read(cls, payload: bytes, keys: int) -> Self:
        """Return the message of a board of so many keys. Raises MessageError."""
        return cls(from_bitmap(payload, keys), keys)


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """All keys, and when they were scanned: sent even if nothing happens, so that a lost EVENT heals."""

    KIND: ClassVar[int] = 0x04

    time_us: int
    closed: int
    keys: int

    def payload(self) -> bytes:
        """Return what the frame carries. Raises OverflowError where a key is closed that there is not."""
        return _TIME.pack(self.time_us) + to_bitmap(self.closed, self.keys)

    @classmethod
    def read(cls, payload: bytes, keys: int) -> Self:
        """Return the message of a board of so many keys. Raises MessageError."""
        if len(payload) < _TIME.size:
            raise MessageError(f"a Heartbeat of {len(payload)} bytes has no room for its time")
        return cls(_TIME.unpack_from(payload)[0], from_bitmap(payload[_TIME.size :], keys), keys)


@dataclass(frozen=True, slots=True)
class Event(Fixed):
    """One key closed (edge 1) or opened (edge 0), and when it was scanned."""

    KIND: ClassVar[int] = 0x03
    LAYOUT: ClassVar[Struct] = Struct("<IHB")

    time_us: int
    key: int
    edge: int


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
    grasp    number of the grasp type in the build's order; NO_GRASP: none
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
class Lost:
    """The keys that cannot be read now: sent when they change, and right before every HEARTBEAT while there are any."""

    KIND: ClassVar[int] = 0x07

    lost: int
    keys: int

    def payload(self) -> bytes:
        """Return what the frame carries. Raises OverflowError where a key is lost that there is not."""
        return to_bitmap(self.lost, self.keys)

    @classmethod
    def read(cls, payload: bytes, keys: int) -> Self:
        """Return the message of a board of so many keys. Raises MessageError."""
        return cls(from_bitmap(payload, keys), keys)


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


FromBoard = Hello | State | Heartbeat | Event | Faults | Grasp | Lost
ToBoard = SetRate | SetDebounce | GetState | Ping
_TO_BOARD: dict[int, type[ToBoard]] = {kind.KIND: kind for kind in (SetRate, SetDebounce, GetState, Ping)}


def frame(message: FromBoard | ToBoard, sequence: int) -> Frame:
    """Return the frame of a message, with its number modulo 256."""
    return Frame(message.KIND, sequence & 0xFF, message.payload())


def from_board(received: Frame, keys: int) -> FromBoard:
    """Return what a board of so many keys says. Raises MessageError."""
    match received.kind:
        case Hello.KIND:
            return Hello.read(received.payload)
        case State.KIND:
            return State.read(received.payload, keys)
        case Heartbeat.KIND:
            return Heartbeat.read(received.payload, keys)
        case Faults.KIND:
            return Faults.read(received.payload)
        case Grasp.KIND:
            return Grasp.read(received.payload)
        case Lost.KIND:
            return Lost.read(received.payload, keys)
        case Event.KIND:
            event = Event.read(received.payload)
            if event.key >= keys or event.edge > 1:
                raise MessageError(f"an EVENT of key {event.key}, edge {event.edge}, from a board of {keys} keys")
            return event
    raise MessageError(f"no message of a scanner board has kind 0x{received.kind:02X}")


def to_board(received: Frame) -> ToBoard:
    """Return what a host asks for. Raises MessageError."""
    kind = _TO_BOARD.get(received.kind)
    if kind is None:
        raise MessageError(f"no message to a scanner board has kind 0x{received.kind:02X}")
    return kind.read(received.payload)
