"""The switch-scanner board, on a serial line or in a Wi-Fi: its closed keys, and codes, with their times."""

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
    EARLY,
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
    """The keys at one time, in the host's monotonic microseconds; and where it is an ANALOG that came, the codes.

    known holds the keys of which anything can be said: none from a lost frame until the board has told all of its keys
    again, none that the board says it cannot read, and of a matrix without diodes only those that cannot be ghosts.
    `closed` holds no others. codes are of the channels that were asked for (`Scanner.analog`), the lowest first, None
    for one that could not be read.
    """

    time_us: int
    closed: Mask
    known: Mask
    codes: tuple[int | None, ...] | None = None


class BoardGrasp(NamedTuple):
    """What a board recognised by itself, in a frame that it read at time_us, in the host's monotonic microseconds.

    number    of the grasp type in the order of the build that the board carries, the one after the last: nothing is
              held; None: it is not known
    margin    the best score less the second, in steps of the build's tables; 65535 stands for more, too
    degraded  whether an input was missing
    early     whether the scan ended as soon as the rest of the switches could not matter
    """

    time_us: int
    number: int | None
    margin: int
    degraded: bool
    early: bool


class BoardSegment(NamedTuple):
    """The segment that a board was in when it read a frame at time_us, in the host's monotonic microseconds.

    number  of grasps so far, modulo 65536; while one is forming, its own
    grasp   the number of the segment's grasp type; None in the state "none"
    state   "none", "forming", "held" or "releasing", as in `runtime.published.LiveGrasp`
    """

    time_us: int
    number: int
    grasp: int | None
    state: str


@dataclass(slots=True)
class ScannerCounts(FrameCounts):
    """What came in since the board was opened.

    Besides frames: gaps in the numbers of the sound ones; misfits, which were sound but said what this board cannot
    say; in a Wi-Fi, datagrams that were missing, late, repeated or foreign, as DatagramCounts has them. And how often
    the state was asked for, something being amiss, and the time.
    """

    gaps: int = 0
    misfits: int = 0
    missing: int = 0
    late: int = 0
    repeated: int = 0
    foreign: int = 0
    asked: int = 0
    pings: int = 0


# Opening the port of an Arduino resets it, and its boot loader answers nobody for up to two seconds.
_BOOT_S = 3.0
_GREETING_S = 0.3
# What was asked for and does not come; and from one loss that was made good to the next.
_ASK_AGAIN_S, _ASK_ANEW_S = 0.1, 0.02


class Scanner(Closing):
    """A scanner board at `url`: a device, socket://HOST:PORT, rfc2217://HOST:PORT; in a Wi-Fi udp://HOST:PORT.

    Boards with USB or Wi-Fi ignore `baud`.

    `open`, then `read` again and again; both raise DeviceError when the board is gone or is not what it was, after
    which opening it again is the way back. For one thread.

    hello   what the board last said of itself
    faults  what it last said of its own troubles; None: nothing yet
    grasp   what it last recognised by itself; None: nothing yet
    segment the segment that it was last in; None: it has not said so, or does not follow segments
    analog  which channels it measures, how often, in how many bits; None before it answered `set_channels`
    times   gives readings their times: by `clock.trip_us` the last may be older, and `late_us` late came the last
            message with a time of its own
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
        self._told: dict[int, _Setting] = {}
        self._token = 0

    def __enter__(self) -> Self:
        self.open()
        return self

    def open(self) -> Hello:
        """Find the board. Raises DeviceError if none answers within three seconds, or one that speaks otherwise."""
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
        """What came in since the board was last opened."""
        keys, times = self._keys, self.times
        seen = asdict(self._frames) | asdict(self._datagrams)
        return ScannerCounts(**seen, gaps=keys.gaps, misfits=self._misfits, asked=self._asked, pings=times.pings)

    def read(self, timeout_s: float) -> ScannerReading | None:
        """Return the next reading, None if there was none in time. Raises DeviceError."""
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
        """Ask for other periods, as in Hello; once the answer was read, `hello` says what came of it.

        A board that restarts is told again. Raises SettingError for a time that no frame can carry.
        """
        self._tell(SetRate(scan_us, state_us, heartbeat_us))

    def set_debounce(self, press_us: int, release_us: int) -> None:
        """Ask for debouncing on the board, as in Hello; answered as `set_rate` is."""
        self._tell(SetDebounce(press_us, release_us))

    def set_channels(self, analog_us: int, wanted: Mask) -> None:
        """Ask for the codes of these channels every `analog_us`, 0: never; once the answer was read, `analog` has it.

        A board that restarts is told again. Raises SettingError for a board that has no analog channels.
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
        """Close the line. Does no harm twice."""
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
        """Add what came in to what waits, after waiting for something until the timeout."""
        received = self._opened().receive(timeout_s)
        came_us = monotonic_ns() // 1000
        self._waiting.extend((came_us, each) for each in received)

    def _tell(self, setting: _Setting) -> None:
        self._send(setting)
        self._told[setting.KIND] = setting

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
                    if self.times.answered:
                        return hello
        wireless = is_datagram_port(self.url)
        at, check = ("", "address, Wi-Fi") if wireless else (f" at {self.baud} baud", "port, baud rate")
        raise DeviceError(
            f"{self.url}: no scanner board answered{at} in {_BOOT_S:g} s ({self._opened().received_bytes} bytes"
            f" came, {self._frames.frames} sound frames): check {check}, power and the board's firmware"
            + (", and whether another program has it open: it hears one at a time" if wireless else "")
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
        """Return the first reading of what waits."""
        while self._waiting:
            if (reading := self._take(*self._waiting.popleft())) is not None:
                return reading
        return None

    def _take(self, came_us: int, received: Received) -> ScannerReading | None:
        """Return what came in as a reading, if it says something new: keys as they are, or that they are unknown."""
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
        """Tell a board that has booted what it was told before."""
        self._keys.restarted()
        self.analog = self.segment = None
        for setting in self._told.values():
            self._send(setting)

    def _recognised(self, message: Grasp | Segment, time_us: int) -> None:
        number = None if message.grasp == NO_GRASP else message.grasp
        if isinstance(message, Segment):
            self.segment = BoardSegment(time_us, message.number, number, STATES[message.state])
        else:
            flags = message.flags
            self.grasp = BoardGrasp(time_us, number, message.margin, bool(flags & DEGRADED), bool(flags & EARLY))

    def _measures(self, message: Channels) -> None:
        if message.token == self._token:
            self.analog = message

    def _message(self, received: Received) -> FromBoard | None:
        """Return what a frame says, None if it says nothing; then an event may have been lost."""
        if isinstance(received, Frame):
            self._keys.numbered(received.sequence)
            try:
                return from_board(received, self._keys.keys)
            except MessageError as reason:
                _LOG.warning("%s: a sound frame was refused: %s", self.url, reason)
                self._misfits += 1
                self._keys.misread()
        elif received is Break.DAMAGED:
            _LOG.info("%s: bytes that are no frame were skipped", self.url)
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
            raise DeviceError(f"{self.url}: another scanner board answers than was opened: open it again")
        self.hello = hello

    def _codes(self, message: Analog) -> tuple[int | None, ...] | None:
        """Return the codes of the channels that were asked for last; None where they are of others."""
        if self.analog is None or message.token != self.analog.token:
            return None
        if len(message.codes) != self.analog.wanted.bit_count():
            self._misfits += 1
            return None
        return tuple(None if code == UNREAD else code for code in message.codes)

    def _ask_again(self) -> None:
        """Ask for a full bitmap where keys cannot be trusted, for channels where nothing answered that; and again."""
        now = monotonic()
        if self._keys.trusted:
            self._ask_at = min(self._ask_at, self._asked_at + _ASK_ANEW_S)
        elif now >= self._ask_at:
            _LOG.info("%s: what the board said of its keys cannot be trusted: all of them are asked for", self.url)
            self._asked_at, self._ask_at = now, now + _ASK_AGAIN_S
            self._asked += 1
            self._send(GetState())
        asked = self._told.get(SetChannels.KIND)
        if asked is not None and self.analog is None and now >= self._channels_at:
            self._channels_at = now + _ASK_AGAIN_S
            self._send(asked)
        asked = self._told.get(SetSegments.KIND)
        if asked is not None and self.segment is None and now >= self._segments_at:
            self._segments_at = now + _ASK_AGAIN_S
            self._send(asked)
