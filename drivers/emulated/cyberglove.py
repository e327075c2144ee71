"""An emulated CyberGlove at the end of a serial line: it replies and streams as fast as a real one.

    with PtyLine(Path("glove")) as line, EmulatedCyberGlove(line) as glove:
        glove.set(bytes(range(60, 78)))

The line emulates a bad cable (`PtyLine.damage`, `.unplug`, `.send` for unsolicited bytes).
"""

from collections import deque
from dataclasses import dataclass
from threading import Condition, Thread
from time import monotonic
from typing import Literal

from ..closing import Closing
from ..cyberglove_protocol import (
    ALWAYS,
    GLOVES,
    INFORMATION,
    PLUGGED,
    READY,
    REPLY_BYTES,
    SET,
    STOP,
    STREAM,
    TEXT_END,
    Record,
    RecordFault,
    digitising_us,
    encode,
    mask_of,
    masked_sensors,
    period_us,
    shortest_us,
)
from ..errors import SettingError
from .serial_line import PtyLine

_SWITCHES = "DFU"  # settings that are 0 or 1
_NOT_READY = 1


@dataclass(frozen=True, slots=True)
class Doubts:
    """Behaviour on which the sources disagree or are silent.

    error_echo   whether an error reply begins with the command's echo
    stop_echo    whether the reply to a Ctrl-C is itself and a NUL
    stray_nul    whether a NUL follows a text reply
    mask         the effect of a sensor mask: accepted, an unknown command, acknowledged and ignored, or reported back
                 but without effect
    """

    error_echo: bool = True
    stop_echo: bool = False
    stray_nul: bool = False
    mask: Literal["taken", "unknown", "ignored", "feigned"] = "taken"


class CyberGloveBox:
    """A glove of 18 or 22 sensors and its box, without a clock or a line: commands in, replies out.

    It understands the commands that the driver sends. While it streams, it understands only Ctrl-C.

    text       the reply to ?i
    not_ready  number of replies 1 to ?G before the reply 3
    doubts     its behaviour where the sources disagree

    plugged is whether the glove is connected to its box. `settings` holds the settings of the box, by letter. Raises
    SettingError for another number of sensors.
    """

    def __init__(
        self, sensors: int = 18, text: str = "CyberGlove, emulated", not_ready: int = 0, doubts: Doubts | None = None
    ) -> None:
        if sensors not in GLOVES:
            raise SettingError(f"there are CyberGloves of 18 and of 22 sensors, not of {sensors}")
        self.sensors, self.text, self.doubts = sensors, text, doubts or Doubts()
        self.plugged, self.streaming = True, False
        self._not_ready, self._pending = not_ready, b""
        self._all = GLOVES[sensors]
        self.values = bytes([100] * sensors)
        # The state after power-up. (No source gives a real box's settings then.)
        self.settings = dict.fromkeys(_SWITCHES, b"\0") | {
            "T": bytes(4),
            "M": mask_of(self._all),
            "N": bytes([sensors]),
        }

    def set(self, values: bytes) -> None:
        """Set the sensor values, one byte of 1 to 255 per sensor. Raises SettingError for others."""
        if len(values) != self.sensors or 0 in values:
            raise SettingError(f"a CyberGlove's {self.sensors} sensors need as many bytes of 1 to 255, not {values!r}")
        self.values = values

    def is_on(self, letter: str) -> bool:
        """Return whether a setting of 0 or 1 is on."""
        return self.settings[letter] != b"\0"

    def apply(self, letter: str, values: bytes) -> bool:
        """Apply the setting of this letter, and return whether it is valid."""
        if letter in _SWITCHES and values[0] > 1:
            return False
        if letter == "N" and not 1 <= values[0] <= len(masked_sensors(self.settings["M"])):
            return False
        if letter == "M":
            self.settings["N"] = bytes([len(self._masked(values))])
        self.settings[letter] = values
        return True

    def record(self, *, too_fast: bool = False) -> bytes:
        """Return a record's bytes on the wire."""
        status = ALWAYS | PLUGGED * self.plugged if self.is_on("U") else None
        fault: RecordFault | None = "unplugged" if not self.plugged else "too fast" if too_fast else None
        return encode(Record(self.sent(), fault, status))

    def sent(self) -> bytes:
        """Return the values of the sensors that mask and number let through, or all if the box ignores its mask."""
        if self.doubts.mask == "feigned":
            return self.values
        names = self._masked(self.settings["M"])[: self.settings["N"][0]]
        return bytes(self.values[self._all.index(name)] for name in names)

    def _masked(self, mask: bytes) -> list[str]:
        return [name for name in masked_sensors(mask) if name in self._all]

    def feed(self, data: bytes) -> list[bytes]:
        """Return the replies to `data`, in order."""
        self._pending += data
        out: list[bytes] = []
        while self._pending:
            used = self._command(out)
            if not used:
                break
            self._pending = self._pending[used:]
        return out

    def _command(self, out: list[bytes]) -> int:
        """Execute the first pending command; return its length, 0 while it is incomplete."""
        first = self._pending[:1]
        letter = first.decode("latin-1")
        if first == STOP:
            self.streaming = False
            out += [STOP + b"\0"] if self.doubts.stop_echo else []
            return 1
        if self.streaming or first in b"\r\n \0":
            return 1
        if first == b"?":
            return self._query(out)
        if first == STREAM:
            self.streaming = True
            return 1
        if letter not in SET or (letter == "M" and self.doubts.mask == "unknown"):
            out.append(self._error(first, b"?"))
            return 1
        size = 1 + SET[letter]
        if len(self._pending) < size:
            return 0
        ignored = letter == "M" and self.doubts.mask == "ignored"
        is_set = ignored or self.apply(letter, self._pending[1:size])
        out.append(first + b"\0" if is_set else self._error(first, b"n"))
        return size

    def _query(self, out: list[bytes]) -> int:
        echo = self._pending[:2]
        if len(echo) < 2:
            return 0
        letter = echo[1:].decode("latin-1")
        if echo == INFORMATION.echo:
            out.append(echo + self.text.encode("ascii") + TEXT_END + b"\0" * self.doubts.stray_nul)
        elif letter in REPLY_BYTES:
            constant = {"S": bytes([self.sensors]), "R": b"\1"}
            values = self._readiness() if letter == "G" else constant.get(letter) or self.settings[letter]
            out.append(echo + values + b"\0")
        else:
            out.append(self._error(echo, b"?"))
        return 2

    def _readiness(self) -> bytes:
        if self._not_ready:
            self._not_ready -= 1
            return bytes([_NOT_READY])
        return bytes([READY if self.plugged else _NOT_READY])

    def _error(self, echo: bytes, kind: bytes) -> bytes:
        return echo * self.doubts.error_echo + b"e" + kind + b"\0"


class EmulatedCyberGlove(Closing):
    """A glove on `line`, in a separate thread: `box`, or an ordinary one of this number of sensors.

    Changes of the box take effect with the next record. Raises SettingError for another number than 18 or 22.
    """

    def __init__(self, line: PtyLine, box: CyberGloveBox | None = None, *, sensors: int = 18) -> None:
        self._line = line
        self.box = box or CyberGloveBox(sensors)
        self._changed = Condition()
        self._heard: deque[bytes] = deque()
        self._closing = False
        self._next = 0.0
        self.records = 0
        self._thread = Thread(target=self._run, name="emulated CyberGlove", daemon=True)
        self._thread.start()
        line.receive = self._receive

    def set(self, sensors: bytes) -> None:
        """Set the sensor values, one byte of 1 to 255 per sensor. Raises SettingError for others."""
        self.box.set(sensors)

    def close(self) -> None:
        """Stop sending and receiving. The line stays."""
        self._line.receive = None
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join()

    def _receive(self, data: bytes) -> None:
        with self._changed:
            self._heard.append(data)
            self._changed.notify()

    def _run(self) -> None:
        while not self._closing:
            if self.box.streaming:
                self._stream()
            for data in self._heard_until(self._next if self.box.streaming else None):
                self._hear(data)

    def _heard_until(self, end: float | None) -> list[bytes]:
        """Return the received chunks as soon as there are any; none at the end, or when closing."""
        with self._changed:
            left = None if end is None else max(0.0, end - monotonic())
            self._changed.wait_for(lambda: self._heard or self._closing, left)
            heard = list(self._heard)
            self._heard.clear()
        return heard

    def _hear(self, data: bytes) -> None:
        was_streaming = self.box.streaming
        for reply in self.box.feed(data):
            self._line.send(reply)
        if self.box.streaming and not was_streaming:
            self._next = monotonic() + digitising_us(len(self.box.sent()), self.box.is_on("F")) / 1e6

    def _stream(self) -> None:
        """Send a record when it is due, and schedule the next by the set period or the shortest possible one."""
        if monotonic() < self._next:
            return
        box, words = self.box, self.box.settings["T"]
        period = period_us((int.from_bytes(words[:2], "big"), int.from_bytes(words[2:], "big")))
        shortest = shortest_us(len(box.sent()), self._line.baud, status=box.is_on("U"), filtered=box.is_on("F"))
        self._line.send(box.record(too_fast=0 < period < shortest))
        self.records += 1
        # If the host wakes this thread late, there is no burst to catch up.
        self._next = max(self._next + max(period, shortest) / 1e6, monotonic())
