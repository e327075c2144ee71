"""Lines or binary frames of a board or a program, over serial, TCP, UDP, Bluetooth or stdin."""

from thenar.drivers.readers import LineReader

from .rows import row_kind

MEMBER = row_kind("line", lambda wiring: LineReader(wiring.port, wiring.baud, len(wiring.columns), wiring.frame), 3)
