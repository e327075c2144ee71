"""The link to a scanner board: frames in order, and breaks where something is missing between them."""

from abc import ABC, abstractmethod
from enum import Enum, auto

from .closing import Closing
from .scanner_protocol import Frame, FrameCounts, FrameDecoder
from .serial_line import SerialLine


class Break(Enum):
    """Why a frame does not follow the one before it."""

    DAMAGED = auto()  # bytes arrived that were not a frame
    MISSING = auto()  # at least one frame between them is missing
    RESTARTED = auto()  # the board has booted


Received = Frame | Break


class ScannerLink(Closing, ABC):
    """An open link to a board. Closing it twice is harmless.

    url  its name in messages      received_bytes  number of bytes received
    """

    url: str
    received_bytes: int

    @abstractmethod
    def send(self, data: bytes, setting: int | None = None) -> None:
        """Send a frame; `setting` is its kind if it is a setting. Raises DeviceError."""

    @abstractmethod
    def receive(self, timeout_s: float) -> list[Received]:
        """Wait for frames until the timeout, and return them. Raises DeviceError if the link is gone."""


class SerialLink(ScannerLink):
    """A serial line, which drops nothing: each frame is sent once."""

    def __init__(self, url: str, baud: int, frames: FrameCounts) -> None:
        """Open it. Raises DeviceError or SettingError as `SerialLine` does."""
        self.url, self.received_bytes = url, 0
        self._decoder = FrameDecoder(frames)
        self._line = SerialLine(url, baud)
        try:
            self._line.write(b"\0")  # ends a half-sent frame in the board's receiver
        except BaseException:
            self._line.close()
            raise

    def send(self, data: bytes, setting: int | None = None) -> None:
        """Send a frame."""
        self._line.write(data)

    def receive(self, timeout_s: float) -> list[Received]:
        """Return the received frames and breaks."""
        data = self._line.read(timeout_s)
        self.received_bytes += len(data)
        return [Break.DAMAGED if each is None else each for each in self._decoder.received(data)]

    def close(self) -> None:
        """Close the line."""
        self._line.close()
