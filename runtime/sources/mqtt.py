"""Messages of an MQTT topic as rows (extra `mqtt`): `port = "mqtt:HOST:PORT/TOPIC"` of a [[stream]].

A message holds one line or more, as `drivers.lines` reads them: numbers with commas between, name:value, or JSON. What
the broker has kept from earlier (a retained message) is left out. A broker that wants a login gets that of the
environment variables MQTT_USERNAME and MQTT_PASSWORD.
"""

import os
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty, Full, Queue
from threading import Event
from time import monotonic_ns
from typing import TYPE_CHECKING, Any

from thenar.drivers.errors import DeviceError, SettingError, ThenarError
from thenar.drivers.extras import optional
from thenar.drivers.lines import Row
from thenar.drivers.names import shortened
from thenar.drivers.readers import LineReader

from .rows import row_kind

if TYPE_CHECKING:
    from paho.mqtt.client import Client

# Messages that wait to be read; more are lost.
_MOST_WAITING = 256
_PLACE = re.compile(r"mqtt:(?:\[([0-9A-Fa-f:.]+)\]|([^][:/]+))(?::([0-9]{1,5}))?/([^+#\0]+)")
_USUAL_PORT = 1883
_CONNECT_S = 2.0
# A broker that does not respond for this long is gone.
_KEEP_ALIVE_S = 4


def place_of(where: str) -> tuple[str, int, str]:
    """Return host, port and topic of mqtt:HOST:PORT/TOPIC, where a port may be left out. Raises SettingError."""
    found = _PLACE.fullmatch(where)
    if found is None or not 0 < int(found[3] or _USUAL_PORT) < 65536:
        raise SettingError(f"{shortened(repr(where))} names no topic: write mqtt:HOST/TOPIC or mqtt:HOST:PORT/TOPIC")
    return found[1] or found[2], int(found[3] or _USUAL_PORT), found[4]


def connect(where: str, kind: type[ThenarError], prepare: Callable[["Client"], Any] = lambda _client: None) -> "Client":
    """Return a client that is connected to the broker of mqtt:HOST:PORT/TOPIC, and works on a separate thread.

    `prepare` gets it before, and sets further callbacks. Raises SettingError for an invalid address or without
    paho-mqtt, an error of this kind if the broker does not accept it.
    """
    host, port, _ = place_of(where)
    with optional(SettingError, where):
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion
    client, replied, refused = Client(CallbackAPIVersion.VERSION2), Event(), list[str]()

    def reply(_client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        refused.extend([str(reason)] if reason.is_failure else [])
        replied.set()

    client.on_connect = reply
    client.connect_timeout = _CONNECT_S
    client.reconnect_delay_set(1, 1)
    if "MQTT_USERNAME" in os.environ:
        client.username_pw_set(os.environ["MQTT_USERNAME"], os.environ.get("MQTT_PASSWORD"))
    prepare(client)
    try:
        client.connect(host, port, _KEEP_ALIVE_S)
    except (OSError, UnicodeError) as reason:
        said = getattr(reason, "strerror", None) or str(reason)
        raise kind(f"{where} cannot be opened: {said}: does the broker run there?") from None
    client.loop_start()
    if not replied.wait(_CONNECT_S) or refused:
        leave(client)
        said = f"{refused[0]}: set MQTT_USERNAME and MQTT_PASSWORD" if refused else "the broker does not respond"
        raise kind(f"{where} cannot be opened: {said}")
    return client


def leave(client: "Client") -> None:
    """End a connection, once all is sent."""
    client.disconnect()
    client.loop_stop()
    if (begun := client.socket()) is not None:  # meanwhile, to a broker that was away
        begun.close()


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


MEMBER = row_kind("mqtt", lambda wiring: MqttReader(wiring.port, columns=len(wiring.columns)), 6)
