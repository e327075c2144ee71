"""Frames to and from a scanner board over a serial line."""

from time import monotonic_ns

from . import scanner_frame
from .scanner_messages import ToBoard, frame
from .serial_line import SerialLine

# When it came in, in the host's monotonic microseconds, and a sound frame, or None for something that was none.
Received = tuple[int, scanner_frame.Frame | None]


class ScannerLink:
    """An open line to a board. Raises DeviceError as the line does."""

    def __init__(self, url: str, baud: int) -> None:
        self._line = SerialLine(url, baud)
        self._decoder = scanner_frame.Decoder()
        self._sequence = 0
        self.received_bytes = 0
        try:
            self._line.write(b"\0")  # ends whatever stands half-sent in the board's receiver
        except BaseException:
            self._line.close()
            raise

    @property
    def counts(self) -> scanner_frame.Counts:
        """What came in."""
        return self._decoder.counts

    def receive(self, timeout_s: float) -> list[Received]:
        """Return what came in, in order, after waiting for something until the timeout."""
        data = self._line.read(timeout_s)
        came_us = monotonic_ns() // 1000
        self.received_bytes += len(data)
        *whole, rest = data.split(b"\0")
        received = [(came_us, found) for piece in whole for found in self._frames(piece + b"\0")]
        self._decoder.feed(rest)
        return received

    def send(self, message: ToBoard) -> None:
        """Send a message."""
        self._line.write(scanner_frame.encode(frame(message, self._sequence)))
        self._sequence += 1

    def close(self) -> None:
        """Close the line."""
        self._line.close()

    def _frames(self, piece: bytes) -> list[scanner_frame.Frame | None]:
        """Feed what ends at one zero: a frame, nothing between two zeros, or something that is no frame."""
        bad = self._bad()
        found: list[scanner_frame.Frame | None] = [*self._decoder.feed(piece)]
        return found or [None] * (self._bad() - bad)

    def _bad(self) -> int:
        counts = self._decoder.counts
        return counts.damaged + counts.short + counts.overlong
