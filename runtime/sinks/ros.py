"""ROS 2 topics without a ROS installation, through Eclipse Cyclone DDS (extra `ros`).

    NAMESPACE/grasp     std_msgs/String                  the grasp type, "unknown" and "none" included
    NAMESPACE/segment   diagnostic_msgs/DiagnosticArray  the same with its stamp, probability, state, segment and health
    NAMESPACE/preshape  trajectory_msgs/JointTrajectory  when it changes
    NAMESPACE/angles    sensor_msgs/JointState           the glove's calibrated joints, in rad
    NAMESPACE/health    std_msgs/String                  once a second, if requested: the glove's health, as JSON

Grasp, segment and angles are published on change and 20 times a second, unless the sink's options set another pace.
Reliable, with the last 10 kept, which serves reliable and best-effort readers alike. Grasp, segment and preshape
are transient local: late readers get the newest at once. Nodes of this machine can read, others if CYCLONEDDS_URI or
`?public` allows them; ROS_DOMAIN_ID sets the domain, as for a ROS 2 node.
"""

from collections.abc import Callable

from msgspec import json

from thenar.drivers.extras import optional

from ..published import HealthReport, JointAngles, LiveGrasp, Preshape
from .base import Sink, SinkError, SinkKind, SinkPlace, SinkReport

_RATE_HZ = 20


class RosTopics(Sink):
    """Publishes under a namespace of ROS. Messages that DDS refuses are counted as lost in the report."""

    def __init__(self, name: str = "/thenar", *, public: bool = False) -> None:
        """Publish under `name` to this machine, or to all networks that Cyclone DDS finds if `public`.

        Raise SettingError for an invalid name or domain, SinkError if DDS does not start.
        """
        # Cyclone DDS, which these import, is an extra.
        from cyclonedds.core import DDSException

        from .. import ros

        self._where = f"ros:{ros.namespace(name)}" + "?public" * public
        self._name, self._ros = name, ros
        number = ros.domain()
        try:
            self._domain, participant = ros.join(number, public=public)
            self._grasp = ros.writer(participant, f"{name}/grasp", ros.String, kept=True)
            self._segment = ros.writer(participant, f"{name}/segment", ros.DiagnosticArray, kept=True)
            self._preshape = ros.writer(participant, f"{name}/preshape", ros.JointTrajectory, kept=True)
            self._angles = ros.writer(participant, f"{name}/angles", ros.JointState)
            self._health = ros.writer(participant, f"{name}/health", ros.String)
        except DDSException as reason:
            raise SinkError(
                f"{self._where} cannot be opened in domain {number}: {reason} "
                "Check CYCLONEDDS_URI, and the network interfaces that it names."
            ) from None
        except OSError as reason:
            raise SinkError(
                f"{self._where} cannot be limited to this machine: {reason.strerror}. That takes Linux 5.7 or newer; "
                f"ros:{name}?public lets other machines read"
            ) from None
        self._closed = False
        self._told: Preshape | None = None
        self._sent = self._lost = 0
        self._error = ""

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Publish everything, but the preshape only if it changed."""
        self._try(lambda: self._write(grasp, preshape, angles))

    def health(self, report: HealthReport) -> None:
        """Publish the glove's health."""
        self._try(lambda: self._health.write(self._ros.String(json.encode(report).decode())))

    def _try(self, write: Callable[[], None]) -> None:
        if self._closed:
            self._lost += 1
            return
        try:
            write()
            self._sent += 1
        except Exception as reason:  # Cyclone's Python side raises many kinds for what it cannot serialise
            self._lost += 1
            self._error = str(reason)

    def _write(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        ros = self._ros
        self._grasp.write(ros.String(grasp.grasp))
        self._segment.write(ros.segment(self._name, grasp))
        if angles is not None:
            self._angles.write(ros.joint_state(grasp.unix_us, angles))
        if preshape is not None and preshape != self._told:
            self._preshape.write(ros.trajectory(preshape))
            self._told = preshape

    def report(self) -> SinkReport:
        """Return the state of this sink; its readers are those of the grasp type."""
        readers = 0 if self._closed else self._grasp.get_publication_matched_status().current_count
        return SinkReport(self._where, readers, self._sent, self._lost, self._error)

    def close(self) -> None:
        """Leave the domain."""
        if not self._closed:
            self._closed = True
            # Each entity ends with its last name; the domain, which ends all that is left in it, goes last.
            del self._grasp, self._segment, self._preshape, self._angles, self._health
            del self._domain


def _open(where: SinkPlace) -> Sink:
    with optional(SinkError, f"ros:{where.place}"):
        return RosTopics(where.place, public="public" in where.options)


MEMBER = SinkKind(
    "ros",
    "/NAMESPACE",
    "topics of ROS 2 on this machine; with public also for others",
    _open,
    ("public",),
    _RATE_HZ,
    rank=4,
)
