"""Where recognised grasps go."""

from .angles import AngleReader, JointAngles
from .fanout import Fanout
from .jsonlines import JsonLines
from .line import HealthLine, Line
from .opening import open_sink
from .sink import Sink, SinkError, SinkReport
from .sockets import SocketLines

__all__ = [
    "AngleReader",
    "Fanout",
    "HealthLine",
    "JointAngles",
    "JsonLines",
    "Line",
    "Sink",
    "SinkError",
    "SinkReport",
    "SocketLines",
    "open_sink",
]
