"""The switch-scanner board, on a serial line or over Wi-Fi: its closed keys and codes, with their times."""

import logging
from collections import deque
from dataclasses import asdict, dataclass
from time import monotonic, monotonic_ns
from typing import NamedTuple, Self

from .closing import Closing
from .errors import DeviceError, SettingError
from .scanner_datagrams import DatagramCounts, DatagramLink, is_datagram_port
from .scanner_link import Break, Received, ScannerLink, SerialLink
from .scanner_protocol import (
    DEGRADED,
    NO_GRASP,
    STATES,
    UNREAD,
    Analog,
    Channels,
    Faults,
    Frame,
    FrameCounts,
    FromBoard,
    GetState,
    Grasp,
    Hello,
    Mask,
    MessageError,
    Segment,
    SetChannels,
    SetDebounce,
    SetRate,
    SetSegments,
    ToBoard,
    encode,
    frame,
    from_board,
)
from .scanner_state import BoardKeys, BoardTimes

_LOG = logging.getLogger(__name__)
_Setting = SetRate | SetDebounce | SetChannels | SetSegments


class ScannerReading(NamedTuple):
    """The keys at one time, in the host's monotonic microseconds; after an ANALOG message also the codes.

    known holds the keys with a known state: none from a lost frame until the board has reported all keys again, none
    that the board cannot read, and of a matrix without diodes only those that cannot be ghosts. `closed` is a subset.
    codes are those of the requested channels (`Scanner.analog`), the lowest first, None for one that could not be read.
    """

    time_us: int
    closed: Mask
    known: Mask
    codes: tuple[int | None, ...] | None = None


class BoardGrasp(NamedTuple):
    """A prediction by the board from a frame that it read at time_us, in the host's monotonic microseconds.

    number    of the grasp type in the order of the build on the board; the number after the last: nothing is held;
              None: unknown
    margin    the best score minus the second, in steps of the build's tables, clipped to 65535
    degraded  whether an input was missing
    """

    time_us: int
    number: int | None
    margin: int
    degraded: bool


class BoardSegment(NamedTuple):
    """The board's segment in a frame that it read at time_us, in the host's monotonic microseconds.

    number  of grasps so far, modulo 65536, including one that is forming
    grasp   the number of the segment's grasp type; None in the state "none"
    state   "none", "forming", "held" or "releasing", as in `runtime.published.LiveGrasp`
    """

    time_us: int
    number: int
    grasp: int | None
    state: str


@dataclass(slots=True)
class ScannerCounts(FrameCounts):
    """Counts since the board was opened.

    In addition to frames: gaps in the numbers of valid ones; misfits, which were valid but impossible for this board;
    over Wi-Fi, datagrams that were missing, late, repeated or foreign, as in DatagramCounts; requests for the state
    after a loss, and for the time.
    """

    gaps: int = 0
    misfits: int = 0
    missing: int = 0
    late: int = 0
    repeated: int = 0
    foreign: int = 0
    asked: int = 0
    pings: int = 0


# Opening the port of an Arduino resets it, and its boot loader does not reply for up to two seconds.
_BOOT_S = 3.0
_GREETING_S = 0.3
# Period of repeated requests; and the shortest time between two recovered losses.
_ASK_AGAIN_S, _ASK_ANEW_S = 0.1, 0.02


class Scanner(Closing):
    """A scanner board at `url`: a device, socket://HOST:PORT, rfc2217://HOST:PORT; over Wi-Fi udp://HOST:PORT.

    Boards with USB or Wi-Fi ignore `baud`.

    Call `open`, then `read` repeatedly. Both raise DeviceError if the board is gone or was replaced; reopen it then.
    Not thread-safe.

    hello   the board's last description of itself
    faults  its last fault counts; None: none yet
    grasp   its last prediction; None: none yet
    segment its last segment; None: not reported, or the board does not follow segments
    analog  its measured channels, their period and bits; None before its reply to `set_channels`
    times   gives readings their times: the last may be older by `clock.trip_us`, and the last message with a time
            stamp arrived `late_us` late
    """

    def __init__(self, url: str, baud: int = 115200) -> None:
        self.url, self.baud = url, baud
        self._link: ScannerLink | None = None
        self._forget()

    def _forget(self) -> None:
        self.hello: Hello | None = None
        self.faults: Faults | None = None
        self.grasp: BoardGrasp | None = None
        self.segment: BoardSegment | None = None
        self.analog: Channels | None = None
        self._frames, self._datagrams = FrameCounts(), DatagramCounts()
        self._sequence = 0
        self._keys = BoardKeys()
        self.times = BoardTimes()
        self._waiting: deque[tuple[int, Received]] = deque()  # when it came in, in the host's monotonic microseconds
        self._misfits = self._asked = 0
        self._asked_at = self._ask_at = self._channels_at = self._segments_at = 0.0
        self._settings: dict[int, _Setting] = {}
        self._token = 0

    def __enter__(self) -> Self:
        self.open()
        return self

    def open(self) -> Hello:
        """Find the board. Raises DeviceError if none replies within three seconds, or with another protocol."""
        self.close()
        self._forget()
        if is_datagram_port(self.url):
            self._link = DatagramLink(self.url, self._frames, self._datagrams)
        else:
            self._link = SerialLink(self.url, self.baud, self._frames)
        try:
            self.hello = self._greet()
            if self.hello.has_segments:
                self._tell(SetSegments(1))
        except BaseException:
            self.close()
            raise
        return self.hello

    @property
    def counts(self) -> ScannerCounts:
        """Counts since the board was last opened."""
        keys, times = self._keys, self.times
        seen = asdict(self._frames) | asdict(self._datagrams)
        return ScannerCounts(**seen, gaps=keys.gaps, misfits=self._misfits, asked=self._asked, pings=times.pings)

    def read(self, timeout_s: float) -> ScannerReading | None:
        """Return the next reading, None at the timeout. Raises DeviceError."""
        end = monotonic() + timeout_s
        if self.times.due:
            self._send(self.times.ping())
        reading = self._next()
        while reading is None:
            left = end - monotonic()
            self._ask_again()
            self._receive(max(0.0, min(left, _ASK_AGAIN_S)))
            reading = self._next()
            if left <= 0:
                break
        return reading

    def set_rate(self, scan_us: int, state_us: int, heartbeat_us: int) -> None:
        """Request other periods, as in Hello; once the reply was read, `hello` has the result.

        A board that restarts gets the setting again. Raises SettingError for a time that no frame can carry.
        """
        self._tell(SetRate(scan_us, state_us, heartbeat_us))

    def set_debounce(self, press_us: int, release_us: int) -> None:
        """Request debouncing on the board, as in Hello, with a reply as for `set_rate`."""
        self._tell(SetDebounce(press_us, release_us))

    def set_channels(self, analog_us: int, wanted: Mask) -> None:
        """Request the codes of these channels every `analog_us`, 0: never; once the reply was read, `analog` has it.

        A board that restarts gets the setting again. Raises SettingError for a board without analog channels.
        """
        if self.hello is not None and not self.hello.has_analog:
            raise SettingError(
                f"{self.url}: the board has no analog channels, its firmware speaks version 1 of the protocol: give it "
                "firmware for a board.toml with [taxels]"
            )
        self.analog, self._token = None, self._token % 0xFF + 1
        self._channels_at = monotonic() + _ASK_AGAIN_S
        self._tell(SetChannels(self._token, analog_us, wanted, wanted.bit_length()))

    def close(self) -> None:
        """Close the line. Closing twice is harmless."""
        link, self._link = self._link, None
        if link is not None:
            link.close()

    def _opened(self) -> ScannerLink:
        if self._link is None:
            raise DeviceError(f"{self.url}: the scanner board is not open")
        return self._link

    def _send(self, message: ToBoard) -> None:
        setting = message.KIND if isinstance(message, _Setting) else None
        self._opened().send(encode(frame(message, self._sequence)), setting)
        self._sequence += 1

    def _receive(self, timeout_s: float) -> None:
        """Wait for messages until the timeout, and queue them."""
        received = self._opened().receive(timeout_s)
        came_us = monotonic_ns() // 1000
        self._waiting.extend((came_us, each) for each in received)

    def _tell(self, setting: _Setting) -> None:
        self._send(setting)
        self._settings[setting.KIND] = setting

    def _greet(self) -> Hello:
        end, ping_at = monotonic() + _BOOT_S, 0.0
        while (now := monotonic()) < end:
            if now >= ping_at:
                self._send(self.times.ping())
                ping_at = now + _GREETING_S
            self._receive(max(0.0, ping_at - now))
            while self._waiting:
                came_us, received = self._waiting.popleft()
                if isinstance(received, Frame) and received.kind == Hello.KIND:
                    hello = self._meet(received, came_us)
                    if self.times.replied:
                        return hello
        wireless = is_datagram_port(self.url)
        at, check = ("", "address, Wi-Fi") if wireless else (f" at {self.baud} baud", "port, baud rate")
        raise DeviceError(
            f"{self.url}: no scanner board replied{at} in {_BOOT_S:g} s ({self._opened().received_bytes} bytes"
            f" came, {self._frames.frames} sound frames): check {check}, power and the board's firmware"
            + (", and whether another program has it open: the board serves one at a time" if wireless else "")
        )

    def _meet(self, received: Frame, came_us: int) -> Hello:
        try:
            hello = Hello.read(received.payload)
        except MessageError as error:
            raise DeviceError(f"{self.url}: {error}") from error
        self._keys = BoardKeys(hello.rows, hello.columns, hello.flags, received.sequence)
        self.times.stamp(hello, came_us)
        return hello

    def _next(self) -> ScannerReading | None:
        """Return the first reading from the queue."""
        while self._waiting:
            if (reading := self._take(*self._waiting.popleft())) is not None:
                return reading
        return None

    def _take(self, came_us: int, received: Received) -> ScannerReading | None:
        """Return a reading if the message says something new: the state of keys, or that it is unknown."""
        keys = self._keys
        was_trusted = keys.trusted
        message = self._message(received)
        time_us = self.times.stamp(message, came_us)
        if isinstance(message, Hello):
            self._same(message)
            if isinstance(received, Frame) and received.sequence == 0 and not message.token:  # it has booted
                self._restarted()
        elif isinstance(message, Faults):
            self.faults = message
        elif isinstance(message, Grasp | Segment):
            self._recognised(message, time_us)
        elif isinstance(message, Channels):
            self._measures(message)
        elif isinstance(message, Analog):
            if (codes := self._codes(message)) is not None:
                return ScannerReading(time_us, keys.closed & keys.known, keys.known, codes)
        elif message is not None:
            keys.heard(message)
            if keys.trusted:
                known = keys.known
                return ScannerReading(time_us, keys.closed & known, known)
        return ScannerReading(time_us, 0, 0) if was_trusted and not keys.trusted else None

    def _restarted(self) -> None:
        """Repeat all settings to a board that has booted."""
        self._keys.restarted()
        self.analog = self.segment = None
        for setting in self._settings.values():
            self._send(setting)

    def _recognised(self, message: Grasp | Segment, time_us: int) -> None:
        number = None if message.grasp == NO_GRASP else message.grasp
        if isinstance(message, Segment):
            self.segment = BoardSegment(time_us, message.number, number, STATES[message.state])
        else:
            self.grasp = BoardGrasp(time_us, number, message.margin, bool(message.flags & DEGRADED))

    def _measures(self, message: Channels) -> None:
        if message.token == self._token:
            self.analog = message

    def _message(self, received: Received) -> FromBoard | None:
        """Return the message of a frame; None if there is none: an event may have been lost."""
        if isinstance(received, Frame):
            self._keys.numbered(received.sequence)
            try:
                return from_board(received, self._keys.keys)
            except MessageError as reason:
                _LOG.warning("%s: a valid frame was rejected: %s", self.url, reason)
                self._misfits += 1
                self._keys.misread()
        elif received is Break.DAMAGED:
            _LOG.info("%s: bytes that are not a frame were skipped", self.url)
            self._keys.damaged()
        else:
            what = "the board has booted" if received is Break.RESTARTED else "datagrams are missing"
            _LOG.info("%s: %s", self.url, what)
            self._keys.misread()
            if received is Break.RESTARTED:
                self._restarted()
        return None

    def _same(self, hello: Hello) -> None:
        if self.hello is not None and hello.identity != self.hello.identity:
            raise DeviceError(f"{self.url}: the scanner board is not the one that was opened: open it again")
        self.hello = hello

    def _codes(self, message: Analog) -> tuple[int | None, ...] | None:
        """Return the codes of the channels that were requested last; None if they belong to an earlier request."""
        if self.analog is None or message.token != self.analog.token:
            return None
        if len(message.codes) != self.analog.wanted.bit_count():
            self._misfits += 1
            return None
        return tuple(None if code == UNREAD else code for code in message.codes)

    def _ask_again(self) -> None:
        """Request a full bitmap if keys cannot be trusted, and repeat settings that had no reply."""
        now = monotonic()
        if self._keys.trusted:
            self._ask_at = min(self._ask_at, self._asked_at + _ASK_ANEW_S)
        elif now >= self._ask_at:
            _LOG.info("%s: the last key states cannot be trusted: requesting all keys", self.url)
            self._asked_at, self._ask_at = now, now + _ASK_AGAIN_S
            self._asked += 1
            self._send(GetState())
        asked = self._settings.get(SetChannels.KIND)
        if asked is not None and self.analog is None and now >= self._channels_at:
            self._channels_at = now + _ASK_AGAIN_S
            self._send(asked)
        asked = self._settings.get(SetSegments.KIND)
        if asked is not None and self.segment is None and now >= self._segments_at:
            self._segments_at = now + _ASK_AGAIN_S
            self._send(asked)
