"""Topics of an MQTT broker (extra `mqtt`): the JSON lines of `jsonl`, each sent at most once (quality of service 0).

    TOPIC/grasp   the line of a grasp
    TOPIC/joints  the header that names the joints of its angles; retained, so that late readers have it, too
    TOPIC/health  once a second, if requested: the glove's health

A broker that goes away is connected to again; what comes meanwhile is lost. One that wants a login gets that of the
environment variables MQTT_USERNAME and MQTT_PASSWORD.
"""

import os
import re
from collections.abc import Callable
from functools import partial
from threading import Event
from typing import TYPE_CHECKING, Any

from thenar.drivers.errors import SettingError, ThenarError
from thenar.drivers.extras import optional
from thenar.drivers.names import shortened

from ..published import HealthReport, JointAngles, LiveGrasp, Preshape
from .base import Sink, SinkError, SinkKind, SinkPlace
from .jsonl import encode, encode_header, encode_health

if TYPE_CHECKING:
    from paho.mqtt.client import Client

_RATE_HZ = 20
# How long a broker may take nothing before a line is lost, live and in a replay.
_LIVE_S, _REPLAY_S = 0.5, 10.0
_PLACE = re.compile(r"mqtt:(?:\[([0-9A-Fa-f:.]+)\]|([^][:/]+))(?::([0-9]{1,5}))?/([^+#\0]+)")
_USUAL_PORT = 1883
_CONNECT_S = 2.0
# A broker that is silent for half as long again is gone.
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
    client, answered, refused = Client(CallbackAPIVersion.VERSION2), Event(), list[str]()

    def answer(_client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        refused.extend([str(reason)] if reason.is_failure else [])
        answered.set()

    client.on_connect = answer
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
    if not answered.wait(_CONNECT_S) or refused:
        leave(client)
        said = f"{refused[0]}: set MQTT_USERNAME and MQTT_PASSWORD" if refused else "the broker does not answer"
        raise kind(f"{where} cannot be opened: {said}")
    return client


def leave(client: "Client") -> None:
    """End a connection, once all is sent."""
    client.disconnect()
    client.loop_stop()
    if (begun := client.socket()) is not None:  # meanwhile, to a broker that was away
        begun.close()


class MqttTopics(Sink):
    """Publishes below a topic, through a connected client."""

    def __init__(self, client: "Client", where: str, longest_s: float = _LIVE_S) -> None:
        self.where, self._client, self._longest_s = where, client, longest_s
        *_, self._topic = place_of(where)
        self._joints: tuple[str, ...] = ()

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Publish the line, after a header if the joints are others than before."""
        if angles is not None and angles.names != self._joints:
            self._joints = angles.names
            self.attempt(partial(self._send, "joints", encode_header(angles), retain=True))
        self.attempt(partial(self._send, "grasp", encode(grasp, preshape, angles)))

    def health(self, report: HealthReport) -> None:
        """Publish the report's line."""
        self.attempt(partial(self._send, "health", encode_health(report)))

    def _send(self, topic: str, line: bytes, *, retain: bool = False) -> None:
        sent = self._client.publish(f"{self._topic}/{topic}", line.rstrip(), retain=retain)
        sent.wait_for_publish(self._longest_s)
        if not sent.is_published():
            raise TimeoutError("the broker takes nothing")

    def close(self) -> None:
        """Leave the broker, once all is sent."""
        leave(self._client)


def _open(where: SinkPlace) -> Sink:
    place = f"mqtt:{where.place}"
    return MqttTopics(connect(place, SinkError), place, _REPLAY_S if where.wait else _LIVE_S)


MEMBER = SinkKind("mqtt", "HOST[:PORT]/TOPIC", "JSON lines to topics of an MQTT broker", _open, rate=_RATE_HZ, rank=7)
