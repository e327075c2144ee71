"""Records as they come in from a CyberGlove that is set up, streamed or polled, each with its time."""

from collections import deque
from time import monotonic, monotonic_ns

from .cyberglove_commands import POLL, STREAM
from .cyberglove_frame import Counts, Decoder, Record
from .cyberglove_setup import GloveInfo, Wanted
from .cyberglove_timing import told_us
from .errors import DeviceError
from .serial_line import SerialLine

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


class Records:
    """Reads records from `line`, streamed, or polled as often as wanted. `counts` goes on where it is."""

    def __init__(self, line: SerialLine, info: GloveInfo, wanted: Wanted, counts: Counts) -> None:
        self._line, self._info, self._counts = line, info, counts
        self._poll, self._period_s = wanted.poll, told_us(wanted.words) / 1e6
        periods_s = _SILENT_PERIODS * info.period_us / 1e6
        self._silent_s, self._noisy_s = max(_SILENT_S, periods_s), max(_NOISY_S, periods_s)
        self._last_us = 0
        self.start()

    def start(self) -> None:
        """Begin, or begin again after the box was asked for something else."""
        self._decoder = Decoder(self._info.sensors, self._counts, self._info.status)
        self._ready: deque[Timed] = deque()
        self._heard_at = self._quiet_from = self._due = self._poll_at = monotonic()
        self._asked = False
        if not self._poll:
            self._line.write(STREAM)

    def read(self, timeout_s: float) -> Timed | None:
        """Return the oldest record not yet returned and when it was in, in microseconds of the monotonic clock.

        Of records that come in together each is a period older than the next, and a polled one was in before it was to
        be asked for again: what stood in a buffer while the host was held up is not taken for new.

        None if none is in by the timeout. Raises DeviceError when the line is gone, or no byte came for half a second,
        or no record for a second (or for four periods, where these are longer).
        """
        end = monotonic() + timeout_s
        while not self._ready:
            self._ask()
            now = monotonic()
            self._receive(min(end, self._given_up_at, self._next_poll()) - now)
            if not self._ready and now >= end:
                return None
        return self._ready.popleft()

    def _ask(self) -> None:
        now = monotonic()
        if not self._poll or now < self._poll_at:
            return
        self._line.write(POLL)
        if not self._asked:
            self._asked, self._heard_at, self._quiet_from = True, now, now
        self._poll_at = now + _POLLED_S
        self._due = max(self._due + self._period_s, now)

    def _next_poll(self) -> float:
        return self._poll_at if self._poll else float("inf")

    @property
    def _given_up_at(self) -> float:
        """When the glove is taken for dead if nothing more comes."""
        return min(self._heard_at + self._silent_s, self._quiet_from + self._noisy_s)

    def _receive(self, seconds: float) -> None:
        data = self._waiting(seconds)
        records = self._decoder.feed(data)
        now_us = monotonic_ns() // 1000
        if data:
            self._heard_at = now_us / 1e6
        if records:
            newest_us = min(now_us, round((self._quiet_from + _POLLED_S) * 1e6)) if self._poll else now_us
            for behind, record in zip(reversed(range(len(records))), records, strict=True):
                self._last_us = max(self._last_us, newest_us - behind * self._info.period_us)
                self._ready.append((self._last_us, record))
            self._quiet_from, self._asked, self._poll_at = now_us / 1e6, False, self._due
        elif now_us / 1e6 > self._given_up_at and self._is_expected():
            silent = now_us / 1e6 - self._heard_at > self._silent_s
            said = f"no byte for {self._silent_s:g}" if silent else f"no record for {self._noisy_s:g}"
            raise DeviceError(f"{self._line.url}: the CyberGlove has sent {said} s: check its power and the cable")

    def _waiting(self, seconds: float) -> bytes:
        """Return what has come in, a backlog up to its end; its last record is then the newest there is."""
        data = self._line.read(max(0.0, seconds))
        if len(data) >= _BACKLOG:
            while len(data) < _LONGEST_BACKLOG and (more := self._line.read(0.0)):
                data += more
        return data

    def _is_expected(self) -> bool:
        return self._asked or not self._poll
