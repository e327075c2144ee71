"""Questions to a CyberGlove's box and their answers, one at a time, while it does not stream."""

from time import monotonic

from .cyberglove_commands import STOP, Answer, Command, find_answer
from .errors import DeviceError
from .serial_line import SerialLine

# An answer's next byte is never further away: 16 ms in an FTDI adapter, 1 ms a byte at 9600 baud, the box's own time.
_ANSWER_S = 0.2
# After a Ctrl-C comes the rest of a record at most, which at 9600 baud takes 27 ms.
_QUIET_S = 0.05
# What a Ctrl-C itself may be answered with; whether it is, no source says.
_STOPPED = STOP + b"\0"
_LONGEST_S = 1.0
_LONGEST = 4096  # bytes among which an answer is looked for; the information text has some hundreds
_TRIES = 3


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
