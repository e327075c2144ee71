"""Sinks by name."""

from thenar.drivers.errors import SettingError

from ..names import shortened
from .jsonlines import open_jsonlines
from .listening import open_tcp, open_unix
from .sink import Sink, SinkError

KINDS = "jsonl:FILE (- is stdout), unix:PATH, tcp:127.0.0.1:PORT, tcp-public:ADDRESS:PORT, ros:/NAMESPACE[?public]"


def open_sink(where: str, *, wait: bool = False) -> Sink:
    """Return the sink that `where` names.

    jsonl:-                   JSON lines on stdout; jsonl:PATH at the end of a file. With `wait`, rather wait for a slow
                              reader than lose lines: for replays
    unix:PATH                 JSON lines to whoever connects to a Unix socket
    tcp:127.0.0.1:PORT        the same on a port of this machine; tcp-public:ADDRESS:PORT lets other machines read too
    ros:/NAMESPACE            topics of ROS 2 on this machine (needs the extra `ros`); ros:/NAMESPACE?public lets other
                              machines read too

    Raises SettingError about a name that means nothing, SinkError about one that cannot be opened.
    """
    kind, colon, place = where.partition(":")
    if not colon or not place:
        raise SettingError(f"{where!r} names no sink: take one of {KINDS}")
    match kind:
        case "jsonl":
            return open_jsonlines(place, wait=wait)
        case "unix":
            return open_unix(place)
        case "tcp" | "tcp-public":
            return open_tcp(place, public=kind == "tcp-public")
        case "ros":
            return _open_ros(place)
    raise SettingError(f"{where!r}: there is no kind of sink called {kind!r}: take one of {KINDS}")


def _open_ros(place: str) -> Sink:
    name, mark, readers = place.partition("?")
    if mark and readers != "public":
        raise SettingError(f"{shortened(repr('ros:' + place))}: behind the question mark can only be `public`")
    try:
        from .dds import RosTopics
    except ImportError as reason:
        raise SinkError(f"ros:{name} needs Cyclone DDS: pip install 'thenar[ros]' ({reason})") from None
    return RosTopics(name, public=bool(mark))
