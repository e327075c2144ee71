"""An emulated scanner board: its messages, their times and its replies; and the board on a serial line."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from threading import Condition, Thread
from time import monotonic_ns

from ..closing import Closing
from ..scanner_protocol import (
    ANALOG,
    ANALOG_VERSION,
    MOST_ASKED,
    NO_GRASP,
    PROTOCOL,
    SEGMENTS,
    UNREAD,
    WITHOUT_DIODES,
    Analog,
    Channels,
    Event,
    Faults,
    FrameDecoder,
    FromBoard,
    GetState,
    Grasp,
    Heartbeat,
    Hello,
    Lost,
    Mask,
    MessageError,
    Ping,
    Segment,
    SetChannels,
    SetDebounce,
    SetRate,
    SetSegments,
    State,
    ToBoard,
    encode,
    frame,
    to_board,
)
from .serial_line import PtyLine

_CLOCK = (1 << 32) - 1
_FASTEST_US = 100
_MOST_MARGIN = 0xFFFF
_FAULTS_EVERY_US = 1_000_000


def read_without_diodes(closed: Mask, rows: int, columns: int) -> Mask:
    """Return the keys, bits row * columns + column, that read closed when those in `closed` are closed.

    Current flows from a row to a column on any path through closed keys: rows that share a closed column are one wire.
    """
    width = (1 << columns) - 1
    wires: list[tuple[set[int], Mask]] = []
    for row in range(rows):
        held = closed >> row * columns & width
        joined = [wire for wire in wires if wire[1] & held]
        wires = [wire for wire in wires if not wire[1] & held]
        members = {row}.union(*(wire[0] for wire in joined))
        for _, others in joined:
            held |= others
        wires.append((members, held))
    return sum(held << row * columns for members, held in wires for row in members)


class ScannerBoard:
    """A model of the board's firmware, in microseconds since boot, which never go back.

    rows, columns  of its keys; one row: wired directly       diodes  whether the keys of a matrix have any
    scan_us        period of scans                            state_us, heartbeat_us  periods of STATE and HEARTBEAT
    clock_us       its 32 bit clock at boot                   board   its number
    channels, bits of its converter: version 2 of the protocol if there are any
    channel_us     time of one channel, including the settling of its multiplexer
    codes          current codes of the channels, in order, None for one that cannot be read; others have 0
    segments       whether it follows segments

    Without STATEs it sends an EVENT for every change. It does not debounce: it only reports the settings back.
    """

    def __init__(
        self,
        rows: int,
        columns: int,
        *,
        diodes: bool = True,
        scan_us: int = 1000,
        state_us: int = 0,
        heartbeat_us: int = 50_000,
        clock_us: int = 0,
        board: int = 1,
        channels: int = 0,
        bits: int = 10,
        channel_us: int = 208,
        segments: bool = False,
    ) -> None:
        self.rows, self.columns, self.diodes, self.clock_us, self.board = rows, columns, diodes, clock_us, board
        self.rate = SetRate(scan_us, state_us, heartbeat_us)
        self.debounce = SetDebounce(0, 0)
        self.analog = Channels(ANALOG_VERSION, 0, bits, 0, 0, channels)
        self.channel_us = channel_us
        self.codes: Sequence[int | None] = ()
        self.segment = Segment(0, 0, NO_GRASP, 0) if segments else None
        self._asked = False
        self.overruns = self.refused = self.dropped = 0
        self._closed: Mask = 0
        self._lost: Mask = 0
        self._scanned = False
        self._sequence = 0
        self._decoder = FrameDecoder()
        self._state_at = self._heartbeat_at = self._faults_at = self._analog_at = 0
        self._scan_at: int | None = None
        self._reported = (0, 0, 0)

    def boot(self, now: int) -> list[bytes]:
        """Return its first bytes: an end, so that nothing before it can matter, and its HELLO.

        It reports no keys before it has scanned all of them once.
        """
        self._scan_at = now
        return [b"\0" + self._sent(self._hello(0, now))]

    def touch(self, now: int) -> None:
        """Record that keys changed: the next scan detects it."""
        if self._scan_at is None:
            self._scan_at = _after(0, self.rate.scan_us, now)

    def next_us(self) -> int | None:
        """Return the time of its next message or scan of changed keys. None: only on request."""
        due = []
        if self._scanned:
            due += [self._state_at] * (self.rate.state_us > 0) + [self._heartbeat_at] * (self.rate.heartbeat_us > 0)
        due += [] if self._scan_at is None else [self._scan_at]
        due += [self._faults_at] * (self._reported != self._faults())
        due += [self._analog_at] * (self.analog.analog_us > 0)
        return min(due, default=None)

    def scan(self, closed: Mask, now: int, *, unread: Mask = 0) -> list[bytes]:
        """Read the keys and the converter, and return the due frames.

        unread  keys that could not be read: they keep their state and are lost
        """
        self._scan_at = None
        sent = self._keys(closed, unread, now)
        if self._reported != self._faults() and now >= self._faults_at:
            self._reported, self._faults_at = self._faults(), now + _FAULTS_EVERY_US
            sent.append(self._sent(Faults(self._clock(now), *self._reported, 0)))
        if self.analog.analog_us and now >= self._analog_at:
            self._analog_at = _after(self._analog_at, self.analog.analog_us, now)
            sent.append(self._sent(Analog(self._clock(now), self.analog.token, self._converted())))
        return sent

    def _converted(self) -> tuple[int, ...]:
        """Return the codes of the requested channels."""
        whole, analog = [*self.codes, *[0] * self.analog.channels], self.analog
        asked = [code for channel, code in enumerate(whole) if analog.wanted >> channel & 1]
        return tuple(UNREAD if code is None else min(max(code, 0), (1 << analog.bits) - 1) for code in asked)

    def recognised(self, grasp: int, margin: int, flags: int, now: int) -> list[bytes]:
        """Return the frames for a predicted grasp; the margin is clipped to the frame's range."""
        return [self._sent(Grasp(self._clock(now), grasp, min(margin, _MOST_MARGIN), flags))]

    def segmented(self, number: int, grasp: int, state: int, now: int) -> list[bytes]:
        """Return the frames for a segment: none before they are requested."""
        self.segment = Segment(self._clock(now), number & 0xFFFF, grasp, state)
        return [self._sent(self.segment)] if self._asked else []

    def receive(self, data: bytes, now: int) -> list[bytes]:
        """Return the replies to the frames that `data` completes."""
        replies = []
        for received in self._decoder.feed(data):
            try:
                replies += self._reply(to_board(received), now)
            except MessageError:
                self.refused += 1
        return replies

    def _reply(self, message: ToBoard, now: int) -> list[bytes]:
        match message:
            case GetState():
                return self._all_keys(now) if self._scanned else []  # the first scan will send them
            case SetRate():
                scan_us = max(message.scan_us, _FASTEST_US)
                state_us, heartbeat_us = (
                    max(period, scan_us) if period else 0 for period in (message.state_us, message.heartbeat_us)
                )
                self.rate = SetRate(scan_us, state_us, heartbeat_us)
                self._state_at = self._heartbeat_at = now
            case SetDebounce():
                self.debounce = message
            case SetChannels():
                return self._measure(message, now)
            case SetSegments():
                return self._tell_segments(bool(message.wanted), now)
        return [self._sent(self._hello(message.token if isinstance(message, Ping) else 0, now))]

    def _measure(self, asked: SetChannels, now: int) -> list[bytes]:
        """Select other channels, the lowest of too many; a board without channels rejects this."""
        analog = self.analog
        if not analog.channels:
            self.refused += 1
            return []
        wanted = asked.wanted & (1 << analog.channels) - 1
        while wanted.bit_count() > MOST_ASKED:
            wanted ^= 1 << wanted.bit_length() - 1
        least_us = max(_FASTEST_US, self.channel_us * wanted.bit_count())
        analog_us = max(asked.analog_us, least_us) if asked.analog_us and wanted else 0
        self.analog = replace(analog, token=asked.token, analog_us=analog_us, wanted=wanted)
        self._analog_at = now + analog_us
        return [self._sent(self.analog)]

    def _tell_segments(self, wanted: bool, now: int) -> list[bytes]:
        """Start or stop sending segments; a board that does not follow segments rejects this."""
        if self.segment is None:
            self.refused += 1
            return []
        self._asked, self.segment = wanted, replace(self.segment, time_us=self._clock(now))
        return [self._sent(self.segment)]

    def _keys(self, closed: Mask, unread: Mask, now: int) -> list[bytes]:
        """Process a scan and return the frames about keys. The first scan reports all of them, and has no changes."""
        before, lost, first = self._closed, self._lost, not self._scanned
        self._closed = before & unread | self._read(closed) & ~unread
        self._lost = unread
        self._scanned = True
        if self.rate.state_us:
            sent = self._due_state(now)
        else:
            changed = 0 if first else before ^ self._closed
            keys = [key for key in range(changed.bit_length()) if changed >> key & 1]
            sent = [self._sent(Event(self._clock(now), key, self._closed >> key & 1)) for key in keys]
        beats = first or bool(self.rate.heartbeat_us and now >= self._heartbeat_at)
        return sent + self._all_keys(now, lost=self._lost != lost, beats=beats)

    def _all_keys(self, now: int, *, lost: bool = False, beats: bool = True) -> list[bytes]:
        """Return a LOST, if it changed or precedes a HEARTBEAT with lost keys; and the HEARTBEAT."""
        tells = lost or (beats and self._lost != 0)
        sent = [self._sent(Lost(self._lost, self.rows * self.columns))] if tells else []
        return [*sent, self._heartbeat(now)] if beats else sent

    def _due_state(self, now: int) -> list[bytes]:
        if now < self._state_at:
            return []
        self._state_at = _after(self._state_at, self.rate.state_us, now)
        return [self._sent(State(self._closed, self.rows * self.columns))]

    def _heartbeat(self, now: int) -> bytes:
        if self.rate.heartbeat_us:
            self._heartbeat_at = _after(self._heartbeat_at, self.rate.heartbeat_us, now)
        return self._sent(Heartbeat(self._clock(now), self._closed, self.rows * self.columns))

    def _hello(self, token: int, now: int) -> Hello:
        flags = (0 if self.diodes else WITHOUT_DIODES) | (ANALOG if self.analog.channels else 0)
        flags |= SEGMENTS if self.segment is not None else 0
        who = (PROTOCOL, flags, token, self.board, 1, 0, 0, self.rows, self.columns)
        rate, debounce = self.rate, self.debounce
        how = (rate.scan_us, rate.state_us, rate.heartbeat_us, debounce.press_us, debounce.release_us)
        return Hello(*who, *how, self._clock(now))

    def _faults(self) -> tuple[int, int, int]:
        bad = self._decoder.counts
        return self.overruns, self.refused + bad.damaged + bad.short + bad.overlong, self.dropped

    def _read(self, closed: Mask) -> Mask:
        return closed if self.diodes else read_without_diodes(closed, self.rows, self.columns)

    def _sent(self, message: FromBoard) -> bytes:
        encoded = encode(frame(message, self._sequence))
        self._sequence += 1
        return encoded

    def _clock(self, now: int) -> int:
        return (now + self.clock_us) & _CLOCK


def _after(last: int, period: int, now: int) -> int:
    """Return the first time after `now` on the schedule of `last`."""
    return last + ((now - last) // period + 1) * period


class EmulatedScanner(Closing):
    """A board with directly wired keys at the far end of `line`; or any other, as `board`.

    It runs until close(), also while the line is unplugged. Keys are read at the board's scans: a change that is undone
    before the next scan is not detected.
    """

    def __init__(self, line: PtyLine, switches: int, *, board: ScannerBoard | None = None) -> None:
        self.line = line
        self.board = board or ScannerBoard(1, switches)
        self._closed: Mask = 0
        self._lost: Mask = 0
        self._closing = False
        self._heard: deque[bytes] = deque()
        self._booted_us = monotonic_ns() // 1000
        self._condition = Condition()
        self._send(self.board.boot(0))
        line.receive = self._receive
        self._thread = Thread(target=self._run, name=f"scanner {line.link}", daemon=True)
        self._thread.start()

    def set(self, closed: Mask) -> None:
        """Close exactly these keys: bit k is key k."""
        with self._condition:
            self._closed = closed
            self.board.touch(self._now())
            self._condition.notify()

    def lose(self, lost: Mask) -> None:
        """Read all keys except these from now on: they keep their state, and the board reports them as lost."""
        with self._condition:
            self._lost = lost
            self.board.touch(self._now())
            self._condition.notify()

    def press(self, codes: Sequence[int | None]) -> None:
        """Set the codes of the channels, in order; None: the channel cannot be read. Others have 0."""
        with self._condition:
            self.board.codes = tuple(codes)

    def recognise(self, grasp: int, margin: int, flags: int = 0) -> None:
        """Send that the board predicted grasp type number `grasp`, with the values of GRASP's fields."""
        with self._condition:
            self._send(self.board.recognised(grasp, margin, flags, self._now()))

    def segment(self, number: int, grasp: int, state: int) -> None:
        """Send that the board is in this segment, with the values of SEGMENT's fields, if the host has requested it."""
        with self._condition:
            self._send(self.board.segmented(number, grasp, state, self._now()))

    def reboot(self, board: ScannerBoard | None = None) -> None:
        """Restart as after a power cut, as `board` if given: numbers and clock start again."""
        with self._condition:
            old = self.board
            self.board = board or ScannerBoard(
                old.rows,
                old.columns,
                diodes=old.diodes,
                board=old.board,
                channels=old.analog.channels,
                bits=old.analog.bits,
                channel_us=old.channel_us,
                segments=old.segment is not None,
            )
            self._booted_us = monotonic_ns() // 1000
            self._send(self.board.boot(0))
            self._condition.notify()

    def close(self) -> None:
        """Stop. The line stays as it is, silent."""
        with self._condition:
            self._closing = True
            self._condition.notify()
        self._thread.join()
        self.line.receive = None

    def _receive(self, data: bytes) -> None:
        with self._condition:
            self._heard.append(data)
            self._condition.notify()

    def _run(self) -> None:
        with self._condition:
            while not self._closing:
                while self._heard:
                    self._send(self.board.receive(self._heard.popleft(), self._now()))
                now, due = self._now(), self.board.next_us()
                if due is not None and due <= now:
                    self._send(self.board.scan(self._closed, now, unread=self._lost))
                else:
                    self._condition.wait(None if due is None else (due - now) / 1e6)

    def _now(self) -> int:
        return monotonic_ns() // 1000 - self._booted_us

    def _send(self, frames: list[bytes]) -> None:
        for each in frames:
            self.line.send(each)
