"""Streams of the Lab Streaming Layer as rows (extra `lsl`): `port = "lsl:NAME"` of a [[stream]].

Channels are columns, by the stream's labels, or in order; its time stamps are the sender's clock. Streams are searched
for on this machine, unless LSL's configuration (LSLAPICFG) says otherwise. Of several with this name, one is read.
"""

from collections.abc import Sequence
from typing import Any

from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.lines import Row, RowReader, finite
from thenar.drivers.lsl import load_pylsl

from .rows import row_kind

_RESOLVE_S, _FORGET_S = 1.0, 2.0
_BUFFER_S = 10
_MOST = 256


class LslReader(RowReader):
    """Rows of the LSL stream with a given name. Its constructor opens nothing."""

    def __init__(self, port: str) -> None:
        self._port, self._name = port, port.removeprefix("lsl:")
        self._inlet: Any = None
        self._search: Any = None
        self._labels: tuple[str, ...] | None = None

    def open(self) -> None:
        """Find the stream and subscribe to it."""
        lsl = load_pylsl(self._port)
        if not self._name or not self._name.isprintable():
            raise SettingError(f"{self._port!r} names no stream: write lsl:NAME")
        found = lsl.resolve_byprop("name", self._name, 1, _RESOLVE_S)
        if not found:
            raise DeviceError(f"{self._port}: there is no LSL stream of this name: is its program running?")
        self._inlet = lsl.StreamInlet(found[0], max_buflen=_BUFFER_S, recover=False)
        self._search = lsl.ContinuousResolver("name", self._name, forget_after=_FORGET_S)
        self._lost = lsl.util.LostError
        try:
            info = self._inlet.info(_RESOLVE_S)
            self._inlet.open_stream(_RESOLVE_S)
        except (self._lost, lsl.util.TimeoutError) as reason:
            raise DeviceError(f"{self._port}: the stream does not respond ({type(reason).__name__})") from reason
        if info.channel_format() == lsl.cf_string:
            raise SettingError(f"{self._port} is a stream of texts: rows are numbers")
        labels = info.get_channel_labels() or ()
        named = all(labels) and len(set(labels)) == info.channel_count() > 0
        self._labels = tuple(labels) if named else None

    def read(self, timeout_s: float) -> Sequence[Row]:
        """Return the samples that arrived."""
        try:
            first, stamp = self._inlet.pull_sample(timeout_s)
            if first is None:
                return ()
            more, stamps = self._inlet.pull_chunk(0.0, _MOST)
        except self._lost as reason:
            raise DeviceError(f"{self._port}: the stream has ended") from reason
        samples = zip((first, *more), (stamp, *stamps), strict=True)
        return [Row(self._labels, tuple(finite(float(value)) for value in sample), time) for sample, time in samples]

    def other_sender(self) -> str:
        """Return a sentence on other streams of this name."""
        search = self._search  # another thread may close it
        number = 0 if search is None else len(search.results())
        return "" if number < 2 else f"{number} LSL streams have this name, and one of them is read: rename the others"

    def close(self) -> None:
        """Leave the stream."""
        self._search = None
        if self._inlet is not None:
            self._inlet.close_stream()
            self._inlet = None


MEMBER = row_kind("lsl", lambda wiring: LslReader(wiring.port), 4)
