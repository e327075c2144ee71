"""Topics of ROS 2, without a ROS installation (extra `ros`)."""

from .base import Sink, SinkError, SinkKind, SinkPlace


def _open(where: SinkPlace) -> Sink:
    try:
        from ..ros.topics import RosTopics
    except ImportError as reason:
        raise SinkError(f"ros:{where.place} needs Cyclone DDS: pip install 'thenar[ros]' ({reason})") from None
    return RosTopics(where.place, public="public" in where.options)


MEMBER = SinkKind(
    "ros", "/NAMESPACE", "topics of ROS 2 on this machine; with ?public others may read", _open, ("public",), rank=4
)
