"""MQTT, by paho-mqtt (extra `mqtt`): addresses of topics, and connections to a broker.

A broker that wants a login gets that of the environment variables MQTT_USERNAME and MQTT_PASSWORD.
"""

import os
import re
from collections.abc import Callable
from threading import Event
from typing import TYPE_CHECKING, Any

from thenar.drivers.errors import SettingError, ThenarError
from thenar.drivers.extras import optional
from thenar.drivers.names import shortened

if TYPE_CHECKING:
    from paho.mqtt.client import Client

_PLACE = re.compile(r"mqtt:(?:\[([0-9A-Fa-f:.]+)\]|([^][:/]+))(?::([0-9]{1,5}))?/([^+#\0]+)")
_USUAL_PORT = 1883
_CONNECT_S = 2.0
# A broker that is silent for half as long again is gone.
_KEEP_ALIVE_S = 4


def topic_of(where: str) -> str:
    """Return the topic of mqtt:HOST/TOPIC or mqtt:HOST:PORT/TOPIC. Raises SettingError for anything else."""
    found = _PLACE.fullmatch(where)
    if found is None or not 0 < int(found[3] or _USUAL_PORT) < 65536:
        raise SettingError(f"{shortened(repr(where))} names no topic: write mqtt:HOST/TOPIC or mqtt:HOST:PORT/TOPIC")
    return found[4]


def connect(where: str, kind: type[ThenarError], prepare: Callable[["Client"], Any] = lambda _client: None) -> "Client":
    """Return a client that is connected to the broker of mqtt:HOST:PORT/TOPIC, and works on a separate thread.

    `prepare` gets it before, and sets further callbacks. Raises SettingError for an invalid address or without
    paho-mqtt, an error of this kind if the broker does not accept it.
    """
    topic_of(where)
    with optional(SettingError, where):
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion
    found = _PLACE.fullmatch(where)
    assert found is not None
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
        client.connect(found[1] or found[2], int(found[3] or _USUAL_PORT), _KEEP_ALIVE_S)
    except (OSError, UnicodeError) as reason:
        said = getattr(reason, "strerror", None) or str(reason)
        raise kind(f"{where} cannot be opened: {said}: does the broker run there?") from None
    client.loop_start()
    if not answered.wait(_CONNECT_S) or refused:
        client.loop_stop()
        said = f"{refused[0]}: set MQTT_USERNAME and MQTT_PASSWORD" if refused else "the broker does not answer"
        raise kind(f"{where} cannot be opened: {said}")
    return client
