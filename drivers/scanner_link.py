"""The way to a scanner board and back: frames in their order, and where something is missing between them."""

from abc import ABC, abstractmethod
from enum import Enum, auto

from .closing import Closing
from .scanner_protocol import Frame, FrameCounts, FrameDecoder
from .serial_line import SerialLine


class Break(Enum):
    """Why a frame does not follow the one before it."""

    DAMAGED = auto()  # something came in that was no frame
    MISSING = auto()  # there was at least one between them that did not come
    RESTARTED = auto()  # the board has booted


Received = Frame | Break


class ScannerLink(Closing, ABC):
    """An open way to a board. Closing it twice does no harm.

    url             names it               received_bytes  came in
    """

    url: str
    received_bytes: int

    @abstractmethod
    def send(self, data: bytes, setting: int | None = None) -> None:
        """Send a frame, of which `setting` says that it is a setting, and of which kind. Raises DeviceError."""

    @abstractmethod
    def receive(self, timeout_s: float) -> list[Received]:
        """Return what came in, after waiting for something until the timeout. Raises DeviceError when it is gone."""


class SerialLink(ScannerLink):
    """A serial line, which drops nothing: what is sent is sent once."""

    def __init__(self, url: str, baud: int, frames: FrameCounts) -> None:
        """Open it. Raises DeviceError or SettingError as `SerialLine` does."""
        self.url, self.received_bytes = url, 0
        self._decoder = FrameDecoder(frames)
        self._line = SerialLine(url, baud)
        try:
            self._line.write(b"\0")  # ends whatever stands half-sent in the board's receiver
        except BaseException:
            self._line.close()
            raise

    def send(self, data: bytes, setting: int | None = None) -> None:
        """Send a frame."""
        self._line.write(data)

    def receive(self, timeout_s: float) -> list[Received]:
        """Return what came in."""
        data = self._line.read(timeout_s)
        self.received_bytes += len(data)
        return [Break.DAMAGED if each is None else each for each in self._decoder.received(data)]

    def close(self) -> None:
        """Close the line."""
        self._line.close()
