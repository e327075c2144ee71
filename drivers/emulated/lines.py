"""Emulated boards or programs that send rows of numbers as lines: over a pty, TCP or UDP."""

import contextlib
import json
import math
import socket
from collections.abc import Callable, Sequence
from threading import Event, Lock, Thread
from time import monotonic

from ..closing import Closing
from ..lines import CLOCK_US, SEQUENCES, UNITS_US, ColumnHeader, checked, parsed, switches_field

# A client that does not accept a line within this time is dropped.
_SEND_S = 0.2
# Columns are named once in this time.
_NAMED_S = 1.0


class LineSender(Closing):
    """Sends the current values to `send`, `rate_hz` times a second: numbers in the order of the columns. With `named`,
    a header comes once a second; where names cannot stand in one, each line is a JSON object.

    The column `time` holds the sender's clock, which counts from the start in `unit`.
    """

    def __init__(
        self,
        send: Callable[[bytes], None],
        columns: Sequence[str],
        rate_hz: float,
        time: str | None,
        unit: str,
        *,
        named: bool = False,
    ) -> None:
        self._send, self._columns, self._time, self._scale = send, tuple(columns), time, 1e6 / UNITS_US[unit]
        header = ",".join(self._columns).encode()
        self._header = (
            header + b"\n" if named and parsed(header) == ColumnHeader(self._columns) and len(columns) > 1 else b""
        )
        self._json, self._named_s = named and not self._header, -math.inf
        self._period_s, self._began = 1 / rate_hz, monotonic()
        self._values = dict.fromkeys(columns, 0.0)
        self._stop = Event()
        self._thread = Thread(target=self._run, name="line sender", daemon=True)
        self._thread.start()

    def show(self, values: dict[str, float]) -> None:
        """Send these values of columns from now on."""
        self._values = self._values | values

    def line(self, now_s: float) -> bytes:
        """Return the line for a time `now_s` after the start."""
        values = self._values
        clock = {} if self._time is None else {self._time: now_s * self._scale}
        row = {name: round(clock.get(name, values.get(name, 0.0)), 6) for name in self._columns}
        text = json.dumps(row) if self._json else ",".join(f"{number:.10g}" for number in row.values())
        named = now_s >= self._named_s + _NAMED_S
        self._named_s = now_s if named else self._named_s
        return self._header * named + text.encode() + b"\n"

    def close(self) -> None:
        """Stop sending."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        due = self._began
        while not self._stop.wait(max(0.0, due - monotonic())):
            self._send(self.line(monotonic() - self._began))
            due = max(due + self._period_s, monotonic() - self._period_s)


class BoardSender(LineSender):
    """Sends the current values like the sketch of a board that prints these switches and readings, which are rounded.

    Numbers of rows count from 0, and the board's clock from the start.
    """

    def __init__(
        self, send: Callable[[bytes], None], switches: Sequence[str], readings: Sequence[str], rate_hz: float
    ) -> None:
        self._switches, self._readings = tuple(switches), tuple(readings)
        self._sequence, self._named_s = 0, -math.inf
        super().__init__(send, (*switches, *readings), rate_hz, None, "us")

    def restart(self) -> None:
        """Begin anew, as after a reset."""
        self._began, self._sequence, self._named_s = monotonic(), 0, -math.inf

    def line(self, now_s: float) -> bytes:
        """Return the row for a time `now_s` after the start, behind the names of the columns once a second."""
        names, values = b"", self._values
        if now_s - self._named_s >= _NAMED_S:
            names, self._named_s = checked(("columns", *self._switches, *self._readings)), now_s
        closed = sum(1 << bit for bit, name in enumerate(self._switches) if values[name] >= 1)
        head = (str(self._sequence), str(round(now_s * 1e6) % CLOCK_US), switches_field(closed, len(self._switches)))
        self._sequence = (self._sequence + 1) % SEQUENCES
        return names + checked(("row", *head, *(str(round(values[name])) for name in self._readings)))


class LineServer(Closing):
    """A server of lines on loopback for all clients; a port of 0 is any free one.

    port  its address, in the form of a `[[stream]]`
    """

    def __init__(self, port: int = 0) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"
        self._clients: list[socket.socket] = []
        self._lock = Lock()
        self._thread = Thread(target=self._accept, name=f"lines at {self.port}", daemon=True)
        self._thread.start()

    def send(self, data: bytes) -> None:
        """Send to all connected clients."""
        with self._lock:
            for client in tuple(self._clients):
                try:
                    client.sendall(data)
                except OSError:
                    client.close()
                    self._clients.remove(client)

    def close(self) -> None:
        """Hang up."""
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join()
        for client in self._clients:
            client.close()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            client.settimeout(_SEND_S)
            with self._lock:
                self._clients.append(client)


class DatagramLines(Closing):
    """A sender of datagrams to a free port of this computer."""

    def __init__(self) -> None:
        self._line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.to: tuple[str, int] = free.getsockname()
        self.port = f"udp://127.0.0.1:{self.to[1]}"

    def send(self, data: bytes) -> None:
        """Send a datagram; there may be no receiver."""
        with contextlib.suppress(OSError):
            self._line.sendto(data, self.to)

    def close(self) -> None:
        """Stop sending."""
        self._line.close()


def lines_like(port: str) -> LineServer | DatagramLines:
    """Return a sender of lines on loopback: of datagrams if `port` takes them, otherwise over TCP."""
    return DatagramLines() if port.startswith("udp:") else LineServer()
