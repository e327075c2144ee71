"""An emulated CyberGlove at the end of a serial line: it replies, is polled and streams as fast as a real one.

    with PtyLine(Path("glove")) as line, EmulatedCyberGlove(line) as glove:
        glove.set(bytes(range(60, 78)))

The line emulates a bad cable (`PtyLine.damage`, `.unplug`, `.send` for unsolicited bytes).
"""

from collections import deque
from threading import Condition, Thread
from time import monotonic

from ..closing import Closing
from ..cyberglove_protocol import TICKS_HZ, digitising_us, period_us, shortest_us
from .cyberglove_box import Action, CyberGloveBox, Doubts, GloveState
from .serial_line import PtyLine

_RESTART_S = 1.75  # from the vendor's manual, as ViSTA quotes it


class EmulatedCyberGlove(Closing):
    """A glove of 18 or 22 sensors on `line`, in a separate thread.

    text       the reply to ?i
    not_ready  number of replies 1 to ?G before the reply 3
    doubts     its behaviour where the sources disagree

    `state` holds the glove and the settings of its box, `box` whether it streams. Changes take effect with the next
    record. Raises SettingError for another number of sensors.
    """

    def __init__(
        self,
        line: PtyLine,
        *,
        sensors: int = 18,
        text: str = "CyberGlove, emulated",
        not_ready: int = 0,
        doubts: Doubts | None = None,
    ) -> None:
        self._line = line
        self.state = GloveState(sensors, not_ready)
        self.box = CyberGloveBox(self.state, text, doubts or Doubts())
        self._changed = Condition()
        self._heard: deque[bytes] = deque()
        self._closing = False
        self._started = monotonic()
        self._next = 0.0
        self.records = 0
        self._thread = Thread(target=self._run, name="emulated CyberGlove", daemon=True)
        self._thread.start()
        line.receive = self._receive

    def set(self, sensors: bytes) -> None:
        """Set the sensor values, one byte of 1 to 255 per sensor. Raises SettingError for others."""
        self.state.set(sensors)

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
            if isinstance(reply, bytes):
                self._line.send(reply)
            else:
                self._act(reply)
        if self.box.streaming and not was_streaming:
            self._next = monotonic() + digitising_us(self._count(), self.state.is_on("F")) / 1e6

    def _act(self, action: Action) -> None:
        if action is Action.RESTARTED:
            self._wait(_RESTART_S)
            self._heard.clear()
            return
        self._wait(digitising_us(self._count(), self.state.is_on("F")) / 1e6)
        as_text = action is Action.POLLED_AS_TEXT
        self._send(self.box.polled_as_text() if as_text else self.state.record(streamed=False, ticks=self._ticks()))

    def _stream(self) -> None:
        """Send a record when it is due, and schedule the next by the set period or the shortest possible one."""
        if monotonic() < self._next:
            return
        settings = self.state.settings
        words = int.from_bytes(settings["T"][:2], "big"), int.from_bytes(settings["T"][2:], "big")
        period = period_us(words)
        shortest = shortest_us(
            self._count(), self._line.baud, status=self.state.is_on("U"), filtered=self.state.is_on("F")
        )
        self._send(self.state.record(streamed=True, too_fast=0 < period < shortest, ticks=self._ticks()))
        # If the host wakes this thread late, there is no burst to catch up.
        self._next = max(self._next + max(period, shortest) / 1e6, monotonic())

    def _send(self, record: bytes) -> None:
        self.records += 1
        self._line.send(record)

    def _wait(self, seconds: float) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._closing, seconds)

    def _count(self) -> int:
        return len(self.state.sent())

    def _ticks(self) -> int:
        return int((monotonic() - self._started) * TICKS_HZ)
