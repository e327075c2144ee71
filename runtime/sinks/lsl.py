"""Streams of the Lab Streaming Layer (extra `lsl`), for recorders and stimulus programs.

    NAME         a text, "Markers": the grasp type, when it changes, "unknown" and "none" included
    NAME-angles  numbers, "MoCap": the glove's calibrated joints in rad, whenever they are measured

A stamp is the time of the moment on the clock of LSL, which is this computer's monotonic clock; for a replay, the time
of sending. The streams are announced on this machine, unless LSL's configuration (LSLAPICFG) says otherwise; LSL
authenticates nobody.
"""

from typing import Any

from thenar.drivers.errors import SettingError
from thenar.drivers.lsl import load_pylsl
from thenar.drivers.names import fault

from ..published import JointAngles, LiveGrasp, Preshape
from .base import Sink, SinkError, SinkKind


class LslStreams(Sink):
    """Publishes streams under a name. Raises SettingError for an invalid name, SinkError if LSL refuses."""

    def __init__(self, name: str, *, stamped: bool = True) -> None:
        self.where, self._name, self._stamped = f"lsl:{name}", name, stamped
        self._lsl = load_pylsl(self.where)
        if reason := fault(name):
            raise SettingError(f"lsl:{name!r} is not a valid stream name: it {reason}")
        self._grasps = self._outlet(name, "Markers", ("grasp",), "string")
        self._angles: Any = None
        self._joints: tuple[str, ...] = ()
        self._measured: JointAngles | None = None
        self._shown, self._closed = "", False

    def _outlet(self, name: str, kind: str, labels: tuple[str, ...], form: str) -> Any:
        lsl = self._lsl
        try:
            info = lsl.StreamInfo(name, kind, len(labels), lsl.IRREGULAR_RATE, form, f"thenar {name}")
            info.set_channel_labels(list(labels))
            return lsl.StreamOutlet(info)
        except (RuntimeError, ValueError, OSError) as reason:
            raise SinkError(f"lsl:{name} cannot be opened: {reason}") from None

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Send the changes."""
        if self._closed:
            return
        stamp = grasp.time_us / 1e6 if self._stamped else 0.0
        if grasp.grasp != self._shown:
            self._shown = grasp.grasp
            self._grasps.push_sample([grasp.grasp], stamp)
            self.sent += 1
        if angles is not None and angles is not self._measured:
            self._measured = angles
            if self._angles is None:
                self._joints = angles.names
                self._angles = self._outlet(f"{self._name}-angles", "MoCap", angles.names, "float32")
            if angles.names == self._joints:
                self._angles.push_sample(list(angles.positions_rad), stamp)

    def close(self) -> None:
        """End the streams."""
        self._closed, self._grasps, self._angles = True, None, None


MEMBER = SinkKind(
    "lsl",
    "NAME",
    "grasp types and joints as streams of the Lab Streaming Layer",
    lambda where: LslStreams(where.place, stamped=not where.wait),
    rank=5,
)
