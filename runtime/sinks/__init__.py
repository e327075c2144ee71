"""The sinks for recognised grasps: one file per kind, found by the registry `SINKS`."""

from ..published import JointAngles
from .base import SINKS, Fanout, Sink, SinkError, SinkKind, SinkPlace, SinkReport, open_sink
from .jsonl import GraspLine, HeaderLine, HealthLine, JsonLines, Line

__all__ = [
    "SINKS",
    "Fanout",
    "GraspLine",
    "HeaderLine",
    "HealthLine",
    "JointAngles",
    "JsonLines",
    "Line",
    "Sink",
    "SinkError",
    "SinkKind",
    "SinkPlace",
    "SinkReport",
    "open_sink",
]
