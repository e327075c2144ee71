"""The CyberGlove on a serial line: detection, set-up, records.

    with CyberGlove("/dev/ttyUSB0") as glove:
        while (timed := glove.read(1.0)) is not None:
            time_us, record = timed

Where the sources of the protocol disagree, each variant is accepted or selectable: docs/reference/devices.md.
"""

from collections import deque
from collections.abc import Collection
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from time import monotonic, monotonic_ns
from typing import Self

from .closing import Closing
from .cyberglove_protocol import (
    GLOVES,
    INFORMATION,
    READY,
    STOP,
    STREAM,
    Command,
    Record,
    RecordCounts,
    RecordDecoder,
    Reply,
    Words,
    find_reply,
    mask_of,
    masked_sensors,
    period_us,
    period_words,
    query,
    setting,
    shortest_us,
)
from .errors import DeviceError, SettingError
from .logs import logger
from .serial_line import SerialLine

_LOG = logger(__name__)

# Longest wait for the next byte of a reply: 16 ms in an FTDI adapter, 1 ms a byte at 9600 baud, the box's own time.
_REPLY_S = 0.2
# After a Ctrl-C at most the rest of a record follows, which takes 27 ms at 9600 baud.
_QUIET_S = 0.05
# A possible reply to Ctrl-C; no source says whether the box sends it.
_STOPPED = STOP + b"\0"
_LONGEST_S = 1.0
_LONGEST = 4096  # bytes searched for a reply; the information text has some hundreds
_TRIES = 3
# The rates that the box supports without an internal change, the usual one first.
# After power-on, a box reports for a while that it is not ready.
_READY_S = 1.0
# After this time without a byte the glove counts as dead: short, since it must be read within a second of its return.
_SILENT_S = 0.5
# The same with bytes, but without a record.
_NOISY_S = 1.0
_SILENT_PERIODS = 4
# More than any line delivers between two reads: a backlog from buffers, after a delay of the host. It is read to its
# end, up to a limit, before its records get times.
_BACKLOG = 2048
_LONGEST_BACKLOG = 1 << 18
Timed = tuple[int, Record]


class Dialogue:
    """Commands and replies over `line`. After an error the box is stopped, and the command is sent again."""

    def __init__(self, line: SerialLine) -> None:
        self._line = line

    def stop_stream(self) -> None:
        """End a stream and drop its remaining bytes. Raises DeviceError if it does not end."""
        end = monotonic() + _LONGEST_S
        while monotonic() < end:
            self._line.write(STOP)
            if not self._line.drain(_QUIET_S).strip(_STOPPED):
                return
        raise DeviceError(
            f"{self._line.url}: the device keeps sending after a Ctrl-C at {self._line.baud} baud: is it a"
            " CyberGlove, and is this its baud rate?"
        )

    def ask(self, command: Command) -> bytes:
        """Return the values of the reply. Raises DeviceError after three attempts without a reply or with errors."""
        reply = None
        for attempt in range(_TRIES):
            if attempt:
                self.stop_stream()
            reply = self._asked_once(command)
            if reply is not None and reply.error is None:
                return reply.values
        if reply is not None:
            raise DeviceError(
                f"{self._line.url}: the CyberGlove replies to {command.name} with an error: {reply.error}"
            )
        raise DeviceError(
            f"{self._line.url}: no CyberGlove replies to {command.name} at {self._line.baud} baud: check its power, the"
            " cable and the baud rate"
        )

    def _asked_once(self, command: Command) -> Reply | None:
        self._line.write(command.request)
        received, end = b"", monotonic() + _LONGEST_S
        while monotonic() < end and len(received) < _LONGEST and (more := self._line.read(_REPLY_S)):
            received += more
            reply = find_reply(command, received)
            if reply is not None:
                return reply
        return find_reply(command, received, last=True)


@dataclass(frozen=True, slots=True)
class GloveInfo:
    """A detected glove and its configuration.

    baud        its rate
    total       number of sensors of the glove, 18 or 22
    places      places, in wire order, of the sensors in a record: all, or those that the box's mask lets through
    names       the names of these sensors, in wire order
    right_hand  whether it is for the right hand; None if the box does not report it
    text        the box's information text
    status      whether records carry the status byte
    period_us   time between records: as requested, or the shortest that box and line should manage
    unmasked    why all sensors are sent though fewer are requested, in a sentence; "" otherwise
    notes       other anomalies, in sentences for the user
    """

    baud: int
    total: int
    places: tuple[int, ...]
    names: tuple[str, ...]
    right_hand: bool | None
    text: str
    status: bool
    period_us: int
    unmasked: str = ""
    notes: tuple[str, ...] = ()

    @property
    def sensors(self) -> int:
        """Number of sensor bytes in a record."""
        return len(self.places)


def open_line(url: str, baud: int) -> SerialLine:
    """Return an open line on which the box replies. Raises DeviceError if it does not."""
    with ExitStack() as opened:
        line = opened.enter_context(SerialLine(url, baud))
        dialogue = Dialogue(line)
        dialogue.stop_stream()
        dialogue.ask(query("G"))
        opened.pop_all()
    return line


def set_up(
    line: SerialLine, words: Words, sensors: int | None, only: Collection[int] | None, filtered: bool | None
) -> GloveInfo:
    """Identify a box that replies, and configure how it sends records.

    words is the period (`cyberglove_protocol.period_words`), the others are as for `CyberGlove`. Raises DeviceError if
    it does not reply or is not a supported glove.
    """
    dialogue = Dialogue(line)
    notes = _until_ready(dialogue, line.url)
    total = _sensors(dialogue, line.url, sensors)
    masked = masked_sensors(_optional(dialogue, query("M")) or b"")
    every = masked if len(masked) == total else GLOVES[total]
    places, unmasked = tuple(range(total)), ""
    if only is not None and 0 < len(only) < total:
        some = tuple(sorted(only))
        if _masked(dialogue, mask_of([every[place] for place in some])):
            places = some
        else:
            _masked(dialogue, mask_of(every))
            unmasked = f"it accepts no sensor mask: all {total} sensors are read, though {len(some)} are requested"
    right, text = _optional(dialogue, query("R")), _optional(dialogue, INFORMATION) or b""
    dialogue.ask(setting("T", packed := b"".join(word.to_bytes(2, "big") for word in words)))
    if _optional(dialogue, query("T")) not in (None, packed):
        notes.append("It keeps a period other than the one set.")
    if filtered is not None:
        _optional(dialogue, setting("F", bytes([filtered])))
    _optional(dialogue, setting("D", b"\0"))  # fails on a box without time stamps
    status = _optional(dialogue, setting("U", b"\1")) is not None
    if not status:
        notes.append("It sends no status byte: plug and wrist switch cannot be seen while it streams.")
    filters = _optional(dialogue, query("F")) not in (None, b"\0")
    if filtered not in (None, filters):
        notes.append(f"Its digital filter stays {'on' if filters else 'off'}, contrary to the setting.")
    period = period_us(words)
    shortest = shortest_us(len(places), line.baud, status=status, filtered=filters)
    if 0.0 < period < shortest:
        notes.append(
            f"{1e6 / period:.0f} records a second are requested, and box and line should manage {1e6 / shortest:.0f}:"
            " request fewer if records come with the fault 'too fast'."
        )
    return GloveInfo(
        baud=line.baud,
        total=total,
        places=places,
        names=tuple(every[place] for place in places),
        right_hand=None if right is None else right != b"\0",
        text="".join(filter(str.isprintable, text.decode("ascii", "replace"))).strip(),
        status=status,
        period_us=round(max(period, shortest)),
        unmasked=unmasked,
        notes=tuple(notes),
    )


def _masked(dialogue: Dialogue, mask: bytes) -> bool:
    """Set the sensor mask of the box, and return whether it confirms it."""
    count = bytes([len(masked_sensors(mask))])
    if _optional(dialogue, setting("M", mask)) is None:
        return False
    if _optional(dialogue, query("N")) != count:
        _optional(dialogue, setting("N", count))
    says = _optional(dialogue, query("M")) or b""
    return masked_sensors(says) == masked_sensors(mask) and _optional(dialogue, query("N")) == count


def _until_ready(dialogue: Dialogue, url: str) -> list[str]:
    """Poll until the box is ready. Sources disagree on the meanings of 1 and 2: both pass, with a note."""
    end = monotonic() + _READY_S
    while (state := dialogue.ask(query("G"))[0]) != READY and monotonic() < end:
        dialogue.stop_stream()
    if state == 0:
        raise DeviceError(f"{url}: the CyberGlove's box is not initialised and has no glove: is one plugged in?")
    return [] if state == READY else [f"?G returns {state}, not {READY}: the glove is unplugged or not initialised."]


def _sensors(dialogue: Dialogue, url: str, expected: int | None) -> int:
    reply = _optional(dialogue, query("N")) or _optional(dialogue, query("S"))
    count = reply[0] if reply else expected
    if count not in (None, *GLOVES):
        # An interrupted program, usually thenar itself, left a mask behind.
        has = _optional(dialogue, query("S"))
        if has is not None and has[0] in GLOVES and _masked(dialogue, mask_of(GLOVES[has[0]])):
            count = has[0]
    if count is None:
        raise DeviceError(f"{url}: the CyberGlove does not report its number of sensors: set `sensors = 18` or 22")
    if expected is not None and count != expected:
        raise SettingError(
            f"{url}: the CyberGlove sends {count} sensors, not {expected}: write `sensors = {count}` under [cyberglove]"
        )
    if count not in GLOVES:
        raise DeviceError(
            f"{url}: the CyberGlove sends {count} sensors, neither 18 nor 22: another program masked some (its M"
            " setting); switch the box off and on"
        )
    return count


def _optional(dialogue: Dialogue, command: Command) -> bytes | None:
    """Return the values of the reply, or None if this box does not know the command; a lost reply is retried."""
    try:
        return dialogue.ask(command)
    except DeviceError:
        dialogue.stop_stream()
        return None


class CyberGlove(Closing):
    """A glove at `url`: a device or socket://HOST:PORT.

    baud     bits a second
    rate_hz  records a second; None: as many as possible
    sensors  18 or 22; None: as reported by the glove
    only     places, in wire order, of the requested sensors; None: all. If the box cannot send only these, by its
             replies or its records, all are sent: see `GloveInfo.places` and `unmasked`
    filtered  whether the box's digital filter is on; None: unchanged

    Use it from one thread at a time. Raises SettingError for a rate that no glove can be set to.
    """

    def __init__(
        self,
        url: str,
        *,
        baud: int = 115_200,
        rate_hz: float | None = None,
        sensors: int | None = None,
        only: Collection[int] | None = None,
        filtered: bool | None = None,
    ) -> None:
        self.url = url
        self.counts = RecordCounts()
        self._baud = baud
        self._words, self._sensors, self._only, self._filtered = period_words(rate_hz), sensors, only, filtered
        self._line: SerialLine | None = None
        self._misfits = 0
        self._unmasked = ""
        self._last_us = 0

    def open(self) -> GloveInfo:
        """Open the line, stop any stream on it, identify the glove, set it up, and start.

        Raises DeviceError if there is no such port, or no supported glove replies.
        """
        self.close()
        line = open_line(self.url, self._baud)
        try:
            info = self._info = set_up(line, self._words, self._sensors, self._only, self._filtered)
            if self._unmasked:
                info = self._info = replace(info, unmasked=self._unmasked)
            if info.unmasked:
                _LOG.warning("%s: %s", self.url, info.unmasked)
            for note in info.notes:
                _LOG.info("%s: %s", self.url, note)
            self._misfits = self.counts.wrong_length
            periods_s = _SILENT_PERIODS * info.period_us / 1e6
            self._silent_s, self._noisy_s = max(_SILENT_S, periods_s), max(_NOISY_S, periods_s)
            self._decoder = RecordDecoder(info.sensors, self.counts, info.status)
            self._ready: deque[Timed] = deque()
            self._heard_at = self._quiet_from = monotonic()
            line.write(STREAM)
        except BaseException:
            line.close()
            raise
        self._line, self._last_us = line, 0
        return info

    def read(self, timeout_s: float) -> Timed | None:
        """Return the oldest record not yet returned, as (time_us, Record); None at the timeout.

        time_us is the arrival of its last byte, in microseconds of the monotonic clock. Of records that arrive together
        each is one period older than the next: a record from a buffer is not mistaken for a new one after a delay of
        the host. A record with the fault "unplugged" holds no measurement.

        Raises DeviceError if the line is gone, no byte came for half a second, or no record for a second (or for four
        periods, if these are longer).
        """
        if self._line is None:
            raise DeviceError(f"{self.url}: the CyberGlove is not open: open() it first")
        end = monotonic() + timeout_s
        while not self._ready:
            now = monotonic()
            self._receive(self._line, min(end, self._given_up_at) - now)
            if not self._ready and now >= end:
                return None
        return self._ready.popleft()

    def close(self) -> None:
        """Stop the stream, unmask all sensors, if that is still possible, and close the line."""
        line, self._line = self._line, None
        if line is not None:
            masked = self._info.sensors < self._info.total
            with suppress(DeviceError):
                line.write(STOP + setting("M", mask_of(GLOVES[self._info.total])).request if masked else STOP)
            line.close()

    def __enter__(self) -> Self:
        self.open()
        return self

    @property
    def _given_up_at(self) -> float:
        """The time at which the glove counts as dead if nothing more arrives."""
        return min(self._heard_at + self._silent_s, self._quiet_from + self._noisy_s)

    def _receive(self, line: SerialLine, seconds: float) -> None:
        data = _waiting(line, seconds)
        records = self._decoder.feed(data)
        now_us = monotonic_ns() // 1000
        if data:
            self._heard_at = now_us / 1e6
        if records:
            for behind, record in zip(reversed(range(len(records))), records, strict=True):
                self._last_us = max(self._last_us, now_us - behind * self._info.period_us)
                self._ready.append((self._last_us, record))
            self._quiet_from = now_us / 1e6
        elif now_us / 1e6 > self._given_up_at:
            line.check_plugged()
            if self._info.sensors < self._info.total and self.counts.wrong_length > self._misfits:
                self._only = None
                self._unmasked = f"its records do not match its sensor mask: all {self._info.total} sensors are read"
            silent = now_us / 1e6 - self._heard_at > self._silent_s
            said = f"no byte for {self._silent_s:g}" if silent else f"no record for {self._noisy_s:g}"
            raise DeviceError(f"{self.url}: the CyberGlove has sent {said} s: check its power and the cable")


def _waiting(line: SerialLine, seconds: float) -> bytes:
    """Return the received bytes, a backlog up to its end, so that its last record is the newest."""
    data = line.read(max(0.0, seconds))
    if len(data) >= _BACKLOG:
        while len(data) < _LONGEST_BACKLOG and (more := line.read(0.0)):
            data += more
    return data
