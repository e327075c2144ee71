"""Topics of an MQTT broker (extra `mqtt`): the JSON lines of `jsonl`, each sent at most once (quality of service 0).

    TOPIC/grasp   the line of a grasp
    TOPIC/joints  the header that names the joints of its angles; retained, so that late readers have it, too
    TOPIC/health  once a second, if requested: the glove's health

A broker that goes away is connected to again; what comes meanwhile is lost. The header is sent to it again.
"""

from ..sources.mqtt import connect, leave, place_of
from .base import Sink, SinkError, SinkKind, SinkPlace
from .jsonl import LineSink

_RATE_HZ = 20
# How long a broker may take nothing before a line is lost, live and in a replay.
_LIVE_S, _REPLAY_S = 0.5, 10.0


class MqttTopics(LineSink):
    """Publishes below the topic of mqtt:HOST:PORT/TOPIC. Raises SettingError and SinkError as `connect` does."""

    def __init__(self, where: str, longest_s: float = _LIVE_S) -> None:
        self.where, self._longest_s = where, longest_s
        *_, self._topic = place_of(where)
        self._client = connect(where, SinkError)
        # A broker that was away lacks the header, or may have lost it.
        self._client.on_connect = lambda *_: setattr(self, "joints", ())

    def send(self, topic: str, line: bytes) -> None:
        """Publish the line."""
        self.attempt(lambda: self._send(topic, line))

    def _send(self, topic: str, line: bytes) -> None:
        sent = self._client.publish(f"{self._topic}/{topic}", line.rstrip(), retain=topic == "joints")
        sent.wait_for_publish(self._longest_s)
        if not sent.is_published():
            raise TimeoutError("the broker takes nothing")

    def close(self) -> None:
        """Leave the broker, once all is sent."""
        leave(self._client)


def _open(where: SinkPlace) -> Sink:
    return MqttTopics(f"mqtt:{where.place}", _REPLAY_S if where.wait else _LIVE_S)


MEMBER = SinkKind("mqtt", "HOST[:PORT]/TOPIC", "JSON lines to topics of an MQTT broker", _open, rate=_RATE_HZ, rank=7)
