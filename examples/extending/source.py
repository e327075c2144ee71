"""A source for your own joints: flex sensors whose codes another program sends as datagrams, a byte per joint."""

import os
import socket
import time
from collections.abc import Iterator

from thenar.drivers.errors import DeviceError
from thenar.runtime.frames import GloveFrame
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.sources import Source, SourceKind

PERIOD_US = 20_000


class FlexSensors(Source):
    """Datagrams on a UDP port of this computer, 50 a second, each the codes of the build's joints."""

    name = "flex sensors"
    period_us = PERIOD_US
    longest_us = 2 * PERIOD_US
    reads_joints = True

    def __init__(self, port: int) -> None:
        self._port = port
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """Take the port."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", self._port))
        except OSError as reason:
            raise DeviceError(f"port {self._port} cannot be taken: {reason.strerror}") from reason

    def read(self, timeout_s: float) -> GloveFrame | None:
        """Return the next datagram as a frame; None if none comes in time."""
        assert self._socket is not None
        self._socket.settimeout(timeout_s)
        try:
            return GloveFrame(time.monotonic_ns() // 1000, self._socket.recv(64))
        except TimeoutError:
            return None

    def close(self) -> None:
        """Let go of the port."""
        if self._socket is not None:
            self._socket.close()


def _sources(_harness: Harness, *_: object) -> Iterator[Source]:
    yield FlexSensors(int(os.environ.get("FLEX_PORT", "9000")))


MEMBER = SourceKind("flex", _sources, rank=9)
