"""Lines of a board or a program: CSV, JSON or name:value, over serial, TCP, UDP or stdin."""

from thenar.drivers.lines import LineReader
from thenar.drivers.transports import OTHER_PORTS

from ..harness.wiring import StreamWiring
from .rows import row_kinds


def _reader(wiring: StreamWiring) -> LineReader:
    return LineReader(wiring.port, wiring.baud, len(wiring.columns))


MEMBER = row_kinds(
    "line",
    "Lines of numbers over serial, TCP, UDP or stdin: [[stream]].",
    lambda port: not port.startswith(OTHER_PORTS),
    _reader,
    3,
)
