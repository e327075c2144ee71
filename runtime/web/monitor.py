"""The page of a run elsewhere: reads and shows the socket that a run publishes on (`--sink tcp:...` or `unix:...`).

The stream holds the predictions and the glove's health. Switches, joints and the probabilities of all types are in it
if the sink was opened with `?detail`, and are shown if its build is available here; otherwise the page omits them.
"""

import re
import socket
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from threading import Event

import msgspec

from thenar.drivers.closing import Closing
from thenar.drivers.errors import DeviceError, SettingError

from ..build import load_manifest
from ..detail import Detail
from ..frames import now_us
from ..hand import load_hand
from ..names import shortened
from ..sinks.jsonl import DetailLine, GraspLine, HealthLine, Line
from .live import Past, build_message
from .server import Server, message

RETRY_S, _WAIT_S = 1.0, 0.2
# Longer than any line of a run: more bytes without a newline are not from a run.
LONGEST_LINE = 1 << 20
_TCP = re.compile(r"tcp:(?:\[([^][]+)\]|([^][:]+)):([0-9]{1,5})")
_decode = msgspec.json.Decoder(Line).decode
# A stream counts as one with details for this long after the last detail; moments without are left out.
_DETAILED_US = 1_000_000


class MonitoredStream(msgspec.Struct, frozen=True):
    """The source of the page's moments, whether it is connected, and its error."""

    where: str
    connected: bool
    error: str = ""


class StreamMonitor(Closing):
    """Shows the stream at `where` on a page; a context manager.

    Parameters
    ----------
    where : str
        "tcp:HOST:PORT" or "unix:PATH", as in the run's sink.
    address, token
        As for `Server`.
    build : Path, optional
        The folder of the build that runs there: its types, switches and joints, and the hand that is drawn.

    Attributes
    ----------
    server : Server
        The server of the page.

    Raises
    ------
    SettingError
        For a `where` that names no stream, and as `Server` does.
    BuildError
        If the build cannot be read.
    """

    def __init__(self, where: str, address: str, *, token: str | None, build: Path | None = None) -> None:
        self._place, self._where = _place(where), where
        self._build, self._first = _first(where, build)
        self._past = Past()
        self._line: GraspLine | None = None
        self._line_us = 0
        self._detailed_us: int | None = None
        self._source = MonitoredStream(where, connected=False, error="not connected yet")
        self.server = Server("live", address, token=token, hello=self._hello)

    def run(self, stop: Event, say: Callable[[MonitoredStream], None] = lambda _: None) -> None:
        """Read and show until `stop` is set, reconnecting if the connection is lost. `say` is called whenever the state
        of the stream changes.
        """
        self._say = say
        while not stop.is_set():
            try:
                with _connected(self._place, self._where) as stream:
                    self._tell(MonitoredStream(self._where, connected=True))
                    for line in _lines(stream, stop):
                        self._show(line)
                if not stop.is_set():
                    self._tell(
                        MonitoredStream(self._where, connected=False, error="the run has ended, or dropped this page")
                    )
            except (DeviceError, OSError) as reason:
                self._tell(MonitoredStream(self._where, connected=False, error=str(reason)))
            stop.wait(RETRY_S)

    def close(self) -> None:
        """Close the page."""
        self.server.close()

    def _show(self, text: bytes) -> None:
        try:
            line = _decode(text)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as wrong:
            raise DeviceError(f"the data is not a stream of thenar: {shortened(str(wrong), 120)}") from None
        if isinstance(line, GraspLine):
            self._past.add(line)
            self._line, self._line_us = line, now_us()
            if self._detailed_us is None or not 0 <= line.time_us - self._detailed_us < _DETAILED_US:
                self.server.publish("frame", partial(_frame, line, self._line_us))
        elif isinstance(line, DetailLine):
            self._detail(line)
        elif isinstance(line, HealthLine):
            self.server.publish("health", partial(message, "health", line))

    def _detail(self, detail: DetailLine) -> None:
        """Show the newest moment with its details, if they are of the given build."""
        if not self._build:
            return
        if detail.build != self._build:
            raise DeviceError("another build runs there than --build names: name that one, or leave out --build")
        line = self._line
        if line is not None and line.number == detail.number:
            self._detailed_us = line.time_us
            more = {name: getattr(detail, name) for name in Detail.__struct_fields__}
            self.server.publish("frame", partial(_frame, line, self._line_us, taxels={}, **more))

    def _tell(self, source: MonitoredStream) -> None:
        self.server.publish("source", message("source", source))
        if source != self._source:
            self._source = source
            self._say(source)

    def _hello(self) -> Sequence[bytes]:
        return (*self._first, self._past.text())


def _first(where: str, folder: Path | None) -> tuple[str, tuple[bytes, ...]]:
    """Return the checksum of the build in a folder, "" without one, and the first messages for a page."""
    if folder is None:
        return "", (build_message(None, None, where, preshapes=True),)
    manifest = load_manifest(folder)
    build = build_message(folder, manifest, where, preshapes=True)
    return manifest.checksum, (build, message("hand", load_hand(folder, manifest)))


def _frame(line: GraspLine, arrived_us: int, **more: object) -> bytes:
    """Return the message of a moment, with its age since it arrived here."""
    return message("frame", line, late_us=now_us() - arrived_us, **more)


def _place(where: str) -> str | tuple[str, int]:
    """Return the path of a socket, or host and port."""
    if where.startswith("unix:") and len(where) > len("unix:"):
        return where.removeprefix("unix:")
    found = _TCP.fullmatch(where)
    if found is None or int(found[3]) > 65535:
        raise SettingError(
            f"{shortened(repr(where))} is not a stream of a run: write tcp:HOST:PORT or unix:PATH, as in its --sink"
        )
    return found[1] or found[2], int(found[3])


def _connected(place: str | tuple[str, int], where: str) -> socket.socket:
    """Return a connection to the stream. Raises DeviceError."""
    try:
        if isinstance(place, tuple):
            return socket.create_connection(place, timeout=RETRY_S)
        stream = socket.socket(socket.AF_UNIX)
        try:
            stream.connect(place)
        except OSError:
            stream.close()
            raise
    except (OSError, UnicodeError) as reason:
        why = getattr(reason, "strerror", None) or str(reason)
        raise DeviceError(f"{where} cannot be opened: {why}; is the run going, with --sink {where}?") from None
    return stream


def _lines(stream: socket.socket, stop: Event) -> Iterator[bytes]:
    """Yield whole lines until the stream ends or `stop` is set."""
    stream.settimeout(_WAIT_S)
    rest = b""
    while not stop.is_set():
        try:
            data = stream.recv(65_536)
        except TimeoutError:
            continue
        if not data:
            return
        *lines, rest = (rest + data).split(b"\n")
        if len(rest) > LONGEST_LINE:
            raise DeviceError("the data is not a stream of thenar: a line does not end")
        yield from filter(None, lines)
