"""Messages of an MQTT topic as rows (extra `mqtt`): `port = "mqtt:HOST:PORT/TOPIC"` of a [[stream]].

A message holds one line or more, as `drivers.lines` reads them: numbers with commas between, name:value, or JSON. What
the broker has kept from earlier (a retained message) is left out.
"""

from collections.abc import Sequence
from contextlib import suppress
from queue import Empty, Full, Queue
from threading import Event
from time import monotonic_ns
from typing import TYPE_CHECKING, Any

from thenar.drivers.errors import DeviceError
from thenar.drivers.lines import LineReader, Row

from ..sinks.mqtt import connect, leave, place_of
from .rows import row_kinds

if TYPE_CHECKING:
    from paho.mqtt.client import Client

# Messages that wait to be read; more are lost.
_MOST_WAITING = 256


class MqttReader(LineReader):
    """Rows of the messages of a topic. The constructor opens nothing."""

    _client: "Client | None" = None

    def open(self) -> None:
        """Subscribe to the topic."""
        self._parser.begin()
        self._came, self._gone = Queue[tuple[bytes, int]](_MOST_WAITING), Event()
        self._client = connect(self.port, DeviceError, self._prepare)
        self._client.subscribe(place_of(self.port)[2])

    def _prepare(self, client: "Client") -> None:
        came, gone = self._came, self._gone

        def take(_client: Any, _data: Any, message: Any) -> None:
            if not message.retain:
                with suppress(Full):
                    came.put_nowait((message.payload, monotonic_ns() // 1000))

        client.on_message = take
        client.on_disconnect = lambda *_: gone.set()

    def read(self, timeout_s: float) -> Sequence[Row]:
        """Return the rows of the next message. Raises DeviceError if the broker is gone."""
        if self._gone.is_set():
            raise DeviceError(f"{self.port}: the broker has ended the connection")
        try:
            payload, came_us = self._came.get(timeout=max(timeout_s, 1e-3))
        except Empty:
            return ()
        return [row._replace(came_us=came_us) for row in self._rows(payload + b"\n")]

    def close(self) -> None:
        """Leave the broker."""
        if self._client is not None:
            leave(self._client)
            self._client = None


MEMBER = row_kinds(
    "mqtt",
    "Messages of an MQTT topic: [[stream]] from mqtt:HOST:PORT/TOPIC.",
    lambda port: port.startswith("mqtt:"),
    lambda wiring: MqttReader(wiring.port, columns=len(wiring.columns)),
    6,
)
