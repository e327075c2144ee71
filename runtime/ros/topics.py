"""ROS 2 topics without a ROS installation, through Eclipse Cyclone DDS (extra `ros`).

    NAMESPACE/grasp     std_msgs/String                  every frame: the grasp type, "unknown" included
    NAMESPACE/preshape  trajectory_msgs/JointTrajectory  when it changes, and again when somebody new listens
    NAMESPACE/angles    sensor_msgs/JointState           every frame with angles: the glove's joints, in rad
    NAMESPACE/health    std_msgs/String                  once a second, if asked for: how the glove fares, as JSON

Reliable, volatile, the last 10 kept: the default of ROS 2, which serves reliable and best-effort readers alike. Nodes
of this machine can read, others where CYCLONEDDS_URI or `?public` lets them; ROS_DOMAIN_ID says which domain, as for a
ROS 2 node.
"""

from collections.abc import Callable
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic
from msgspec import json

from ..preshape.selector import Preshape
from ..published import HealthReport, JointAngles, LiveGrasp
from ..sinks.base import Sink, SinkError, SinkReport
from .domain import dds_topic, domain, join, namespace
from .messages import (
    TYPE_HASHES,
    Duration,
    Header,
    JointState,
    JointTrajectory,
    JointTrajectoryPoint,
    PackedAngles,
    PackedString,
    String,
    Time,
)

_DEPTH = 10


class RosTopics(Sink):
    """Publishes under a namespace of ROS. What DDS refuses is counted as lost and told in the report."""

    def __init__(self, name: str = "/thenar", *, public: bool = False) -> None:
        """Publish under `name` to this machine, or to all networks that Cyclone DDS finds if `public`.

        Raise SettingError about a name or a domain that ROS cannot have, SinkError if DDS does not start.
        """
        self._where = f"ros:{namespace(name)}" + "?public" * public
        number = domain()
        try:
            self._domain, participant = join(number, public=public)
            self._grasp = _writer(participant, f"{name}/grasp", String)
            self._preshape = _writer(participant, f"{name}/preshape", JointTrajectory)
            self._angles = _writer(participant, f"{name}/angles", JointState)
            self._health = _writer(participant, f"{name}/health", String)
        except DDSException as reason:
            raise SinkError(
                f"{self._where} cannot be opened in domain {number}: {reason} "
                "Look at CYCLONEDDS_URI, and at the network interfaces that it names."
            ) from None
        except OSError as reason:
            raise SinkError(
                f"{self._where} cannot be kept to this machine: {reason.strerror}. That takes Linux 5.7 or newer; "
                f"ros:{name}?public lets other machines read"
            ) from None
        self._closed = False
        self._strings: dict[str, PackedString] = {}
        self._state: PackedAngles | None = None
        self._told: tuple[Preshape | None, int] = (None, 0)
        self._sent = self._lost = 0
        self._error = ""

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Publish the grasp type, the preshape if it is news to somebody, and the angles."""
        self._try(lambda: self._write(grasp, preshape, angles))

    def health(self, report: HealthReport) -> None:
        """Publish how the glove fares."""
        self._try(lambda: self._health.write(String(json.encode(report).decode())))

    def _try(self, write: Callable[[], None]) -> None:
        if self._closed:
            self._lost += 1
            return
        try:
            write()
            self._sent += 1
        except Exception as reason:  # Cyclone's Python side raises all kinds about what it cannot serialise
            self._lost += 1
            self._error = str(reason)

    def _write(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        self._grasp.write(self._string(grasp.grasp))
        if preshape is not None:
            self._tell(preshape)
        if angles is not None:
            self._angles.write(self._packed(grasp.unix_us, angles))

    def _string(self, text: str) -> PackedString:
        if text not in self._strings:
            self._strings[text] = PackedString(text)
        return self._strings[text]

    def _tell(self, preshape: Preshape) -> None:
        """Publish `preshape` unless everybody who listens was told it."""
        news = (preshape, self._preshape.get_publication_matched_status().total_count)
        if news != self._told:
            self._preshape.write(trajectory(preshape))
            self._told = news

    def _packed(self, unix_us: int, angles: JointAngles) -> PackedAngles:
        if self._state is None or self._state.names != angles.names:
            self._state = PackedAngles(angles.names)
        self._state.set(unix_us, angles)
        return self._state

    def report(self) -> SinkReport:
        """Return how this sink is doing; its readers are those of the grasp type."""
        readers = 0 if self._closed else self._grasp.get_publication_matched_status().current_count
        return SinkReport(self._where, readers, self._sent, self._lost, self._error)

    def close(self) -> None:
        """Leave the domain."""
        if not self._closed:
            self._closed = True
            # Each goes with its last name; the domain, which ends what is left in it, goes last.
            del self._grasp, self._preshape, self._angles, self._health
            del self._domain


def trajectory(preshape: Preshape) -> JointTrajectory:
    """Return a preshape as a trajectory of one point, to be started on arrival (a stamp of zero)."""
    seconds, rest = divmod(round(preshape.time_from_start_s * 1_000_000_000), 1_000_000_000)
    point = JointTrajectoryPoint(list(preshape.positions), [], [], [], Duration(seconds, rest))
    return JointTrajectory(Header(Time(0, 0), ""), list(preshape.joint_names), [point])


def _writer(participant: DomainParticipant, name: str, kind: Any) -> Any:
    qos = Qos(
        # Nobody may hold the writer up: what does not fit is refused at once.
        Policy.Reliability.Reliable(max_blocking_time=0),
        Policy.Durability.Volatile,
        Policy.History.KeepLast(_DEPTH),
        Policy.WriterDataLifecycle(autodispose=False),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        Policy.Userdata(f"typehash={TYPE_HASHES[kind.__idl_typename__]};".encode()),
    )
    return DataWriter(participant, Topic(participant, dds_topic(name), kind), qos=qos)
