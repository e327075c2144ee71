"""What goes to stdout and to sockets, as lines of JSON: grasps, and now and then how the glove fares.

A reader tells them apart by `kind`; msgspec does so by itself: `msgspec.json.decode(line, type=Line | HealthLine)`.
"""

from msgspec import json

from ..live.health import HealthReport
from ..live.published import LiveGrasp
from ..preshape.preshape import Preshape
from .angles import JointAngles


class Line(LiveGrasp, frozen=True, tag_field="kind", tag="grasp"):
    """The fields of `LiveGrasp`, and behind them the preshape and the angles, null where there are none."""

    preshape: Preshape | None = None
    angles: JointAngles | None = None


class HealthLine(HealthReport, frozen=True, tag_field="kind", tag="health"):
    """The fields of `HealthReport`."""


_encode = json.Encoder().encode
_GRASP, _PRESHAPE, _ANGLES = b'{"kind":"grasp",', b',"preshape":', b',"angles":'


def encode(grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> bytes:
    """Return a frame's line, its newline included. UTF-8, no newline inside.

    The bytes of a `Line`, without making one.
    """
    parts = (_GRASP, _encode(grasp)[1:-1], _PRESHAPE, _encode(preshape), _ANGLES, _encode(angles), b"}\n")
    return b"".join(parts)


def encode_health(report: HealthReport) -> bytes:
    """Return a report's line, its newline included."""
    return _encode(HealthLine(**{name: getattr(report, name) for name in report.__struct_fields__})) + b"\n"
