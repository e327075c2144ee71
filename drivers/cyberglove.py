"""The CyberGlove on a serial line: found, set up, read, its light and wrist switch.

    with CyberGlove("/dev/ttyUSB0") as glove:
        while (timed := glove.read(1.0)) is not None:
            time_us, record = timed

Everything that the sources of the protocol disagree on is accepted either way, or can be chosen: docs/cyberglove.md.
"""

from contextlib import suppress
from types import TracebackType
from typing import Literal, Self

from .cyberglove_commands import STOP, Command, query, setting
from .cyberglove_dialogue import Dialogue
from .cyberglove_frame import Counts
from .cyberglove_records import Records, Timed
from .cyberglove_setup import BAUD_RATES, GloveInfo, Wanted, find_line, set_up
from .cyberglove_timing import period_words
from .errors import DeviceError
from .serial_line import SerialLine

Mode = Literal["stream", "poll"]


class CyberGlove:
    """A glove at `url`: a device, socket://HOST:PORT or rfc2217://HOST:PORT.

    baud     bits a second; None tries the rates that a box can be set to
    mode     "stream": the box sends by its own clock; "poll": it is asked for each record
    rate_hz  records a second; None: as many as there can be
    sensors  18 or 22; None: as many as the glove says
    status   whether records shall carry the status byte

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
    ) -> None:
        self.url = url
        self.counts = Counts()
        self._rates = BAUD_RATES if baud is None else (baud,)
        self._wanted = Wanted(period_words(rate_hz), poll=mode == "poll", sensors=sensors, status=status)
        self._line: SerialLine | None = None
        self._records: Records | None = None

    def open(self) -> GloveInfo:
        """Open the line, stop what streams on it, learn what glove it is, set it up, and begin.

        Raises DeviceError if there is no such port, no glove that answers, or none that can be read.
        """
        self.close()
        line = find_line(self.url, self._rates)
        try:
            info = set_up(line, self._wanted)
            self._records = Records(line, info, self._wanted, self.counts)
        except BaseException:
            line.close()
            raise
        self._line = line
        return info

    def read(self, timeout_s: float) -> Timed | None:
        """Return the oldest record not yet returned, as (time_us, Record); None if none is in by the timeout.

        time_us is when its last byte was in, in microseconds of the monotonic clock. A record with the fault
        "unplugged" holds no measurement. Raises DeviceError when the line is gone, or no record comes any more.
        """
        return self._opened()[1].read(timeout_s)

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
        """Stop the stream, where that is still possible, and close the line."""
        line, self._line, self._records = self._line, None, None
        if line is not None:
            with suppress(DeviceError):
                line.write(STOP)
            line.close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _ask(self, command: Command) -> bytes:
        line, records = self._opened()
        dialogue = Dialogue(line)
        dialogue.hush()
        try:
            return dialogue.ask(command)
        finally:
            records.start()

    def _opened(self) -> tuple[SerialLine, Records]:
        if self._line is None or self._records is None:
            raise DeviceError(f"{self.url}: the CyberGlove is not open: open() it first")
        return self._line, self._records
