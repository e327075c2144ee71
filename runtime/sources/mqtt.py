"""Messages of an MQTT topic as rows (extra `mqtt`): `port = "mqtt:HOST:PORT/TOPIC"` of a [[stream]].

A message holds one line or more, as `drivers.lines` reads them: numbers with commas between, name:value, or JSON. What
the broker has kept from earlier (a retained message) is left out.
"""

from contextlib import suppress
from queue import Empty, Full, Queue
from threading import Event
from time import monotonic_ns
from typing import TYPE_CHECKING, Any

from thenar.drivers.errors import DeviceError
from thenar.drivers.lines import LineReader
from thenar.drivers.transports import Datagrams

from .. import mqtt
from ..harness.wiring import StreamWiring
from .rows import row_kinds

if TYPE_CHECKING:
    from paho.mqtt.client import Client

# Messages that wait to be read; more are lost.
_MOST_WAITING = 256


class Subscription(Datagrams):
    """The messages of a topic, from entering to leaving the broker."""

    def __init__(self, port: str) -> None:
        self._port = port
        self._came: Queue[tuple[bytes, int]] = Queue(_MOST_WAITING)
        self._gone = Event()
        self._client = mqtt.connect(port, DeviceError, self._prepare)
        self._client.subscribe(mqtt.topic_of(port))

    def _prepare(self, client: "Client") -> None:
        def take(_client: Any, _data: Any, message: Any) -> None:
            if not message.retain:
                with suppress(Full):
                    self._came.put_nowait((message.payload, monotonic_ns() // 1000))

        client.on_message = take
        client.on_disconnect = lambda *_: self._gone.set()

    def read(self, timeout_s: float) -> tuple[bytes, str, int] | None:
        """Return the next message, its topic, and when it came. Raises DeviceError if the broker is gone."""
        if self._gone.is_set():
            raise DeviceError(f"{self._port}: the broker has ended the connection")
        try:
            payload, came_us = self._came.get(timeout=max(timeout_s, 1e-3))
        except Empty:
            return None
        return payload, self._port, came_us

    def close(self) -> None:
        """Leave the broker."""
        self._client.disconnect()
        self._client.loop_stop()


class MqttReader(LineReader):
    """Rows of the messages of a topic. The constructor opens nothing."""

    def open(self) -> None:
        """Subscribe to the topic."""
        self._parser.begin()
        self._line = Subscription(self.port)


def _reader(wiring: StreamWiring) -> MqttReader:
    return MqttReader(wiring.port, columns=len(wiring.columns))


MEMBER = row_kinds(
    "mqtt",
    "Messages of an MQTT topic: [[stream]] from mqtt:HOST:PORT/TOPIC.",
    lambda port: port.startswith("mqtt:"),
    _reader,
    6,
)
