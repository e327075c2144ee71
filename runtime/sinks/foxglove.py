"""Live topics for Foxglove, over Foxglove's WebSocket protocol (extra `foxglove`); messages are JSON, with schemas.

    /thenar/grasp     the grasp type, probability, state, segment and health
    /thenar/joints    names and angles of calibrated joints in rad, with `grasp`
    /thenar/preshape  the preshape, with `grasp`
    /thenar/health    once a second, if requested: the glove's health

A grasp comes on change and 50 times a second, unless the sink's options set another pace. A message has the time of its
frame. A topic without subscribers costs nothing. A reader's queue is bounded and drops the oldest first: a reader that
stops delays nobody. The SDK's server runs on separate threads; readers can only request topics. A web page open in a
browser of this machine may read as Foxglove does.

Scores and switches are on the page of `--web`. Foxglove's schemas have no null, no alternatives and no references: None
is left out of its message.
"""

import re
from typing import Any

import msgspec

from thenar.drivers.extras import optional

from ..published import HealthReport, JointAngles, LiveGrasp, Preshape
from .base import Sink, SinkError, SinkKind, SinkPlace
from .sockets import resolve

_RATE_HZ = 50
# Messages queued for one reader, over all topics: about two seconds.
BACKLOG = 512


TOPICS: dict[str, type[msgspec.Struct]] = {
    "/thenar/grasp": LiveGrasp,
    "/thenar/joints": JointAngles,
    "/thenar/preshape": Preshape,
    "/thenar/health": HealthReport,
}


def schemas() -> dict[str, dict[str, Any]]:
    """Return the JSON schema of each topic, in the subset that Foxglove supports."""
    found = {}
    for topic, kind in TOPICS.items():
        (whole,), shared = msgspec.json.schema_components((kind,), ref_template="{name}")
        found[topic] = {"title": f"thenar.{kind.__name__}", **_plain(whole, shared)}
    return found


def _plain(found: dict[str, Any], shared: dict[str, dict[str, Any]]) -> dict[str, Any]:
    if "$ref" in found:
        return _plain(shared[found["$ref"]], shared)
    if "anyOf" in found:
        return _plain(next(each for each in found["anyOf"] if each != {"type": "null"}), shared)
    if "enum" in found:
        return {"type": "string"}
    if found["type"] == "array":
        return {"type": "array", "items": _plain(found["items"], shared)}
    if found["type"] == "object":
        fields = {name: _plain(field, shared) for name, field in found["properties"].items()}
        return {"type": "object", "properties": fields}
    return {"type": found["type"]}


def encode(content: msgspec.Struct) -> bytes:
    """Return a message: the fields that are not None."""
    fields = msgspec.structs.asdict(content)
    return msgspec.json.encode({name: value for name, value in fields.items() if value is not None})


class FoxgloveServer(Sink):
    """Serves Foxglove at an address. Raises SettingError for an invalid one, SinkError if it cannot be served.

    `host` is an address, `port` 0 any free one: the attribute `port` is the one in use.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 8765, *, where: str = "") -> None:
        # The SDK is an extra.
        import foxglove

        self.where = where or f"foxglove:{host}:{port}"
        # Channels end when it is garbage-collected.
        self._context = context = foxglove.Context()
        self._channels = {
            topic: foxglove.Channel(topic, schema=schema, message_encoding="json", context=context)
            for topic, schema in schemas().items()
        }
        try:
            self._server = foxglove.start_server(
                name="thenar",
                host=host,
                port=port,
                context=context,
                message_backlog_size=BACKLOG,
            )
        except (RuntimeError, OSError) as reason:
            said = re.sub(r" \(os error [0-9]+\)", "", str(reason).removeprefix("FoxgloveError: "))
            hint = ": another process serves that port; use another" if "in use" in said else ""
            raise SinkError(f"{self.where} cannot be opened: {said}{hint}") from None
        self.port: int = self._server.port
        self._unix_us = self._time_us = 0

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Publish the grasp, the angles and the preshape."""
        self._time_us, self._unix_us = grasp.time_us, grasp.unix_us
        for topic, content in (("grasp", grasp), ("joints", angles), ("preshape", preshape)):
            if content is not None:
                self._log(f"/thenar/{topic}", content)

    def health(self, report: HealthReport) -> None:
        """Publish the glove's health."""
        self._log("/thenar/health", report, report.time_us - self._time_us)

    def _log(self, topic: str, content: msgspec.Struct, later_us: int = 0) -> None:
        """Pass a message to the server if its topic has readers, stamped `later_us` after the newest frame.

        The server does not report the messages that it drops for slow readers.
        """
        channel, log_time = self._channels[topic], 1000 * max(0, self._unix_us + later_us)
        if channel.has_sinks():
            self.attempt(lambda: channel.log(encode(content), log_time=log_time))

    def close(self) -> None:
        """Stop the server and its connections."""
        self._server.stop()
        for channel in self._channels.values():
            channel.close()


def _open(where: SinkPlace) -> Sink:
    _, address = resolve(where.place, where.text, "foxglove:127.0.0.1:8765", public="public" in where.options)
    with optional(SinkError, where.text):
        return FoxgloveServer(*address[:2], where=where.text)


MEMBER = SinkKind(
    "foxglove",
    "127.0.0.1:PORT",
    "live topics for Foxglove; with public also for other machines",
    _open,
    ("public",),
    _RATE_HZ,
    rank=6,
)
