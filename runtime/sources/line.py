"""Lines of a board or a program: CSV, JSON or name:value, over serial, TCP, UDP, a Unix socket, stdin, a WebSocket."""

from thenar.drivers.lines import LineReader

from ..harness.wiring import StreamWiring
from .rows import row_kinds


def _reader(wiring: StreamWiring) -> LineReader:
    return LineReader(wiring.port, wiring.baud, len(wiring.columns), wiring.sender or "")


MEMBER = row_kinds(
    "line",
    "Lines of numbers over serial, TCP, UDP, a Unix socket, stdin or a WebSocket: [[stream]].",
    lambda port: not port.startswith(("lsl:", "ros:")),
    _reader,
    3,
)
