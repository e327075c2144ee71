"""The CyberGlove on a serial line: found, set up, read, its light and wrist switch.

    with CyberGlove("/dev/ttyUSB0") as glove:
        while (timed := glove.read(1.0)) is not None:
            time_us, record = timed

Where the protocol's sources disagree, every variant is accepted or selectable: docs/reference/devices.md.
"""

import logging
from collections import deque
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from time import monotonic, monotonic_ns
from typing import Literal, Self

from .closing import Closing
from .cyberglove_protocol import (
    FASTEST,
    INFORMATION,
    POLL,
    READY,
    SENSORS_18,
    SENSORS_22,
    STOP,
    STREAM,
    Answer,
    Command,
    Record,
    RecordCounts,
    RecordDecoder,
    Words,
    find_answer,
    mask_of,
    masked_sensors,
    period_words,
    query,
    sending_us,
    setting,
    shortest_us,
    told_us,
)
from .errors import DeviceError, SettingError
from .serial_line import SerialLine

_LOG = logging.getLogger(__name__)

# An answer's next byte is never further away: 16 ms in an FTDI adapter, 1 ms a byte at 9600 baud, the box's own time.
_ANSWER_S = 0.2
# After a Ctrl-C comes the rest of a record at most, which at 9600 baud takes 27 ms.
_QUIET_S = 0.05
# What a Ctrl-C itself may be answered with; whether it is, no source says.
_STOPPED = STOP + b"\0"
_LONGEST_S = 1.0
_LONGEST = 4096  # bytes among which an answer is looked for; the information text has some hundreds
_TRIES = 3
# The rates that the box can be set to without a change inside it, the usual first.
BAUD_RATES = (115_200, 38_400, 19_200, 9_600)
# After it is switched on, a box says for a while that it is not ready.
_READY_S = 1.0
_NAMES = {18: SENSORS_18, 22: SENSORS_22}
# When a poll is taken for lost: a record takes 27 ms at 9600 baud, an FTDI adapter adds 16.
_POLLED_S = 0.2
# When a glove is taken for dead of which no byte comes: soon, for it must be read again within a second of its return.
_SILENT_S = 0.5
# And when bytes come, but no record.
_NOISY_S = 1.0
_SILENT_PERIODS = 4
# More than any line brings between two readings: what stood in buffers while the host was held up. It is read up to its
# end, so far as that comes, before it is given times.
_BACKLOG = 2048
_LONGEST_BACKLOG = 1 << 18
Timed = tuple[int, Record]
Mode = Literal["stream", "poll"]


class Dialogue:
    """Asks over `line`. What goes wrong on the wire is asked again, after the box was made to stop whatever it does."""

    def __init__(self, line: SerialLine) -> None:
        self._line = line

    def hush(self) -> None:
        """End a stream, and drop what still comes. Raises DeviceError if it does not end."""
        end = monotonic() + _LONGEST_S
        while monotonic() < end:
            self._line.write(STOP)
            if not self._line.drain(_QUIET_S).strip(_STOPPED):
                return
        raise DeviceError(
            f"{self._line.url}: what is there keeps sending after a Ctrl-C at {self._line.baud} baud: is it a"
            " CyberGlove, and is this its baud rate?"
        )

    def ask(self, command: Command) -> bytes:
        """Return the values of the answer. Raises DeviceError if three times none comes, or only errors."""
        answer = None
        for attempt in range(_TRIES):
            if attempt:
                self.hush()
            answer = self._asked_once(command)
            if answer is not None and answer.error is None:
                return answer.values
        raise DeviceError(f"{self._line.url}: {_complaint(command, answer, self._line.baud)}")

    def _asked_once(self, command: Command) -> Answer | None:
        self._line.write(command.request)
        received, end = b"", monotonic() + _LONGEST_S
        while monotonic() < end and len(received) < _LONGEST and (more := self._line.read(_ANSWER_S)):
            received += more
            answer = find_answer(command, received)
            if answer is not None:
                return answer
        return find_answer(command, received, last=True)


def _complaint(command: Command, answer: Answer | None, baud: int) -> str:
    if answer is not None:
        return f"the CyberGlove answers {command.name} with an error: {answer.error}"
    return f"no CyberGlove answers {command.name} at {baud} baud: check its power, the cable and the baud rate"


@dataclass(frozen=True, slots=True)
class Wanted:
    """How a glove shall send.

    words    the period (`cyberglove_protocol.period_words`)
    poll     whether it shall be asked for each record, so that the host keeps the period
    sensors  how many it must have; None: as many as it says
    status   whether records shall carry the status byte
    only     places, in wire order, of the sensors that it shall send; None: all
    filtered  whether its digital filter shall be on; None: as it is
    """

    words: Words
    poll: bool
    sensors: int | None
    status: bool
    only: frozenset[int] | None = None
    filtered: bool | None = None


@dataclass(frozen=True, slots=True)
class GloveInfo:
    """What was found at the end of the line.

    baud        its rate
    total       how many sensors the glove has, 18 or 22
    places      which of them, in wire order, records hold: all, or those that the box's mask lets through
    names       what these measure, in wire order
    mask        the software mask, 3 bytes, the lowest bit of the first one first; empty where the box does not tell
    right_hand  for which hand it is; None where the box does not tell
    text        the box's information text
    status      whether records carry the status byte
    period_us   from one record to the next: as wanted, or the shortest that box and line should manage
    unmasked    why all sensors are sent though fewer are wanted, in a sentence; "" where that is not so
    notes       what else is odd, in sentences for the user
    """

    baud: int
    total: int
    places: tuple[int, ...]
    names: tuple[str, ...]
    mask: bytes
    right_hand: bool | None
    text: str
    status: bool
    period_us: int
    unmasked: str = ""
    notes: tuple[str, ...] = ()

    @property
    def sensors(self) -> int:
        """How many bytes of sensors a record has."""
        return len(self.places)


def find_line(url: str, rates: Sequence[int]) -> SerialLine:
    """Return an open line to a box that answers, at the first of `rates` at which it does. Raises DeviceError else."""
    for baud in rates:
        line = SerialLine(url, baud)
        try:
            dialogue = Dialogue(line)
            dialogue.hush()
            dialogue.ask(query("G"))
        except DeviceError as reason:
            line.close()
            if len(rates) == 1:
                raise
            failure = reason
        except BaseException:
            line.close()
            raise
        else:
            return line
    tried = ", ".join(map(str, rates))
    raise DeviceError(f"{url}: no CyberGlove answers at {tried} baud: check its power and the cable") from failure


def set_up(line: SerialLine, wanted: Wanted) -> GloveInfo:
    """Ask a box that answers what it is, and tell it how to send records.

    Raises DeviceError if it does not answer, or is no glove that can be read.
    """
    dialogue = Dialogue(line)
    notes = _until_ready(dialogue, line.url)
    total = _sensors(dialogue, line.url, wanted.sensors)
    mask = _optional(dialogue, query("M")) or b""
    every = masked if len(masked := masked_sensors(mask)) == total else _NAMES[total]
    places, unmasked = tuple(range(total)), ""
    if wanted.only is not None and 0 < len(wanted.only) < total:
        some = tuple(sorted(wanted.only))
        if _masked(dialogue, fewer := mask_of([every[place] for place in some])):
            places, mask = some, fewer
        else:
            _masked(dialogue, mask_of(every))
            unmasked = f"it takes no sensor mask: all {total} sensors are read, though {len(some)} are asked for"
    right, text = _optional(dialogue, query("R")), _optional(dialogue, INFORMATION) or b""
    status, odd = _configured(dialogue, wanted)
    filtered = _optional(dialogue, query("F")) not in (None, b"\0")
    if wanted.filtered not in (None, filtered):
        odd += (f"Its digital filter stays {'on' if filtered else 'off'}, whatever it is told.",)
    told, shortest = told_us(wanted.words), shortest_us(len(places), line.baud, status=status, filtered=filtered)
    if wanted.poll:
        shortest += sending_us(len(POLL), line.baud)
    return GloveInfo(
        baud=line.baud,
        total=total,
        places=places,
        names=tuple(every[place] for place in places),
        mask=mask,
        right_hand=None if right is None else right != b"\0",
        text="".join(filter(str.isprintable, text.decode("ascii", "replace"))).strip(),
        status=status,
        period_us=round(max(told, shortest)),
        unmasked=unmasked,
        notes=notes + odd + _rate_note(told, shortest),
    )


def _masked(dialogue: Dialogue, mask: bytes) -> bool:
    """Let the box send the sensors of a mask, and return whether it says that it does."""
    count = bytes([len(masked_sensors(mask))])
    if _optional(dialogue, setting("M", mask)) is None:
        return False
    if _optional(dialogue, query("N")) != count:
        _optional(dialogue, setting("N", count))
    says = _optional(dialogue, query("M")) or b""
    return masked_sensors(says) == masked_sensors(mask) and _optional(dialogue, query("N")) == count


def _configured(dialogue: Dialogue, wanted: Wanted) -> tuple[bool, tuple[str, ...]]:
    """Tell the box how to send; return whether its records will carry the status byte, and what it did not take."""
    words = b"".join(word.to_bytes(2, "big") for word in (FASTEST if wanted.poll else wanted.words))
    dialogue.ask(setting("T", words))
    odd: tuple[str, ...] = ()
    if _optional(dialogue, query("T")) not in (None, words):
        odd = ("It keeps another period than it is told.",)
    if wanted.filtered is not None:
        _optional(dialogue, setting("F", bytes([wanted.filtered])))
    _optional(dialogue, setting("D", b"\0"))  # a box without time stamps has none to switch off
    status = _optional(dialogue, setting("U", bytes([wanted.status]))) is not None
    if wanted.status and not status:
        odd += ("It sends no status byte: plug and wrist switch cannot be seen while it streams.",)
    return status and wanted.status, odd


def _until_ready(dialogue: Dialogue, url: str) -> tuple[str, ...]:
    """Ask until the box is ready. Which of 1 and 2 means what, sources disagree: both pass, with a note."""
    end = monotonic() + _READY_S
    while (state := dialogue.ask(query("G"))[0]) != READY and monotonic() < end:
        dialogue.hush()
    if state == 0:
        raise DeviceError(f"{url}: the CyberGlove's box is neither initialised nor has it a glove: is one plugged in?")
    return () if state == READY else (f"?G says {state}, not {READY}: the glove is unplugged or not initialised.",)


def _sensors(dialogue: Dialogue, url: str, expected: int | None) -> int:
    answer = _optional(dialogue, query("N")) or _optional(dialogue, query("S"))
    count = answer[0] if answer else expected
    if count not in (None, *_NAMES):
        # A program that was cut off left a mask behind: thenar itself, as a rule.
        has = _optional(dialogue, query("S"))
        if has is not None and has[0] in _NAMES and _masked(dialogue, mask_of(_NAMES[has[0]])):
            count = has[0]
    if count is None:
        raise DeviceError(f"{url}: the CyberGlove does not say how many sensors it has: say so (sensors = 18, or 22)")
    if expected is not None and count != expected:
        raise SettingError(
            f"{url}: the CyberGlove sends {count} sensors, not {expected}: write `sensors = {count}` under [cyberglove]"
        )
    if count not in _NAMES:
        raise DeviceError(
            f"{url}: the CyberGlove sends {count} sensors, neither 18 nor 22: another program masked some (its M"
            " setting); switch the box off and on"
        )
    return count


def _rate_note(told: float, shortest: float) -> tuple[str, ...]:
    if not 0.0 < told < shortest:
        return ()
    return (
        f"{1e6 / told:.0f} records a second are asked for, and box and line should manage {1e6 / shortest:.0f}: ask"
        " for fewer if records come with the fault 'too fast'.",
    )


def _optional(dialogue: Dialogue, command: Command) -> bytes | None:
    """Return the values of the answer, None where this box does not know the command: never for a lost answer."""
    try:
        return dialogue.ask(command)
    except DeviceError:
        dialogue.hush()
        return None


class CyberGlove(Closing):
    """A glove at `url`: a device, socket://HOST:PORT or rfc2217://HOST:PORT.

    baud     bits a second; None tries the rates that a box can be set to
    mode     "stream": the box sends by its own clock; "poll": it is asked for each record
    rate_hz  records a second; None: as many as there can be
    sensors  18 or 22; None: as many as the glove says
    status   whether records shall carry the status byte
    only     places, in wire order, of the sensors that are wanted; None: all. A box that does not send these alone,
             by what it says or by what it sends, sends all: `GloveInfo.places` and `unmasked` say so
    filtered  whether the box's digital filter shall be on; None: as it is

    Use it from one thread at a time. Raises SettingError for a rate that no glove can be told.
    """

    def __init__(
        self,
        url: str,
        *,
        baud: int | None = 115_200,
        mode: Mode = "stream",
        rate_hz: float | None = None,
        sensors: int | None = None,
        status: bool = True,
        only: Collection[int] | None = None,
        filtered: bool | None = None,
    ) -> None:
        self.url = url
        self.counts = RecordCounts()
        self._rates = BAUD_RATES if baud is None else (baud,)
        self._wanted = Wanted(
            period_words(rate_hz),
            poll=mode == "poll",
            sensors=sensors,
            status=status,
            only=None if only is None else frozenset(only),
            filtered=filtered,
        )
        self._line: SerialLine | None = None
        self._misfits = 0
        self._unmasked = ""
        self._last_us = 0

    def open(self) -> GloveInfo:
        """Open the line, stop what streams on it, learn what glove it is, set it up, and begin.

        Raises DeviceError if there is no such port, no glove that answers, or none that can be read.
        """
        self.close()
        line = find_line(self.url, self._rates)
        try:
            info = self._info = set_up(line, self._wanted)
            if self._unmasked:
                info = self._info = replace(info, unmasked=self._unmasked)
            if info.unmasked:
                _LOG.warning("%s: %s", self.url, info.unmasked)
            for note in info.notes:
                _LOG.info("%s: %s", self.url, note)
            self._misfits = self.counts.wrong_length
            periods_s = _SILENT_PERIODS * info.period_us / 1e6
            self._silent_s, self._noisy_s = max(_SILENT_S, periods_s), max(_NOISY_S, periods_s)
            self._start(line)
        except BaseException:
            line.close()
            raise
        self._line, self._last_us = line, 0
        return info

    def read(self, timeout_s: float) -> Timed | None:
        """Return the oldest record not yet returned, as (time_us, Record); None if none is in by the timeout.

        time_us is when its last byte was in, in microseconds of the monotonic clock. Of records that come in together
        each is a period older than the next, and a polled one was in before it was to be asked for again: what stood in
        a buffer while the host was held up is not taken for new. A record with the fault "unplugged" holds no
        measurement.

        Raises DeviceError when the line is gone, or no byte came for half a second, or no record for a second (or for
        four periods, where these are longer).
        """
        line, end = self._opened(), monotonic() + timeout_s
        while not self._ready:
            now = monotonic()
            until = min(end, self._given_up_at)
            if self._wanted.poll:
                self._poll(line, now)
                until = min(end, self._given_up_at, self._poll_at)
            self._receive(line, until - now)
            if not self._ready and now >= end:
                return None
        return self._ready.popleft()

    def light(self, on: bool) -> None:
        """Switch the light at the wrist. A stream pauses for it. Raises DeviceError as `ask` does."""
        self._ask(setting("L", bytes([on])))

    def switch(self) -> bool:
        """Return whether the switch at the wrist is on (the status byte of records tells without a pause)."""
        return self.ask("W") != b"\0"

    def ask(self, letter: str) -> bytes:
        """Return the values that the box answers to the query of this letter. A stream pauses for it.

        Raises DeviceError if the line is gone or the box does not answer, SettingError if there is no such query.
        """
        return self._ask(query(letter))

    def close(self) -> None:
        """Stop the stream, let all sensors through again, where that is still possible, and close the line."""
        line, self._line = self._line, None
        if line is not None:
            masked = self._info.sensors < self._info.total
            with suppress(DeviceError):
                line.write(STOP + setting("M", mask_of(_NAMES[self._info.total])).request if masked else STOP)
            line.close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def _ask(self, command: Command) -> bytes:
        line = self._opened()
        dialogue = Dialogue(line)
        dialogue.hush()
        try:
            return dialogue.ask(command)
        finally:
            self._start(line)

    def _opened(self) -> SerialLine:
        if self._line is None:
            raise DeviceError(f"{self.url}: the CyberGlove is not open: open() it first")
        return self._line

    def _start(self, line: SerialLine) -> None:
        """Begin, or begin again after the box was asked for something else."""
        self._decoder = RecordDecoder(self._info.sensors, self.counts, self._info.status)
        self._ready: deque[Timed] = deque()
        self._heard_at = self._quiet_from = self._due = self._poll_at = monotonic()
        self._expected = not self._wanted.poll
        if self._expected:
            line.write(STREAM)

    def _poll(self, line: SerialLine, now: float) -> None:
        """Ask for a record when one is due, or when the last one is taken for lost."""
        if now < self._poll_at:
            return
        line.write(POLL)
        if not self._expected:
            self._expected, self._heard_at, self._quiet_from = True, now, now
        self._poll_at = now + _POLLED_S
        self._due = max(self._due + told_us(self._wanted.words) / 1e6, now)

    @property
    def _given_up_at(self) -> float:
        """When the glove is taken for dead if nothing more comes."""
        return min(self._heard_at + self._silent_s, self._quiet_from + self._noisy_s)

    def _receive(self, line: SerialLine, seconds: float) -> None:
        data = _waiting(line, seconds)
        records = self._decoder.feed(data)
        now_us = monotonic_ns() // 1000
        if data:
            self._heard_at = now_us / 1e6
        if records:
            polled = self._wanted.poll
            newest_us = min(now_us, round((self._quiet_from + _POLLED_S) * 1e6)) if polled else now_us
            for behind, record in zip(reversed(range(len(records))), records, strict=True):
                self._last_us = max(self._last_us, newest_us - behind * self._info.period_us)
                self._ready.append((self._last_us, record))
            self._quiet_from, self._expected, self._poll_at = now_us / 1e6, not polled, self._due
        elif now_us / 1e6 > self._given_up_at and self._expected:
            line.check_plugged()
            if self._info.sensors < self._info.total and self.counts.wrong_length > self._misfits:
                total, self._wanted = self._info.total, replace(self._wanted, only=None)
                self._unmasked = f"its records are not what its sensor mask says: all {total} sensors are read"
            silent = now_us / 1e6 - self._heard_at > self._silent_s
            said = f"no byte for {self._silent_s:g}" if silent else f"no record for {self._noisy_s:g}"
            raise DeviceError(f"{self.url}: the CyberGlove has sent {said} s: check its power and the cable")


def _waiting(line: SerialLine, seconds: float) -> bytes:
    """Return what has come in, a backlog up to its end; its last record is then the newest there is."""
    data = line.read(max(0.0, seconds))
    if len(data) >= _BACKLOG:
        while len(data) < _LONGEST_BACKLOG and (more := line.read(0.0)):
            data += more
    return data
