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
from functools import cache
from typing import TYPE_CHECKING

from msgspec import json

from ..preshape.selector import Preshape
from ..published import HealthReport, JointAngles, LiveGrasp
from .base import Sink, SinkError, SinkKind, SinkPlace, SinkReport

if TYPE_CHECKING:
    from ..ros.messages import PackedAngles


class RosTopics(Sink):
    """Publishes under a namespace of ROS. What DDS refuses is counted as lost and told in the report."""

    def __init__(self, name: str = "/thenar", *, public: bool = False) -> None:
        """Publish under `name` to this machine, or to all networks that Cyclone DDS finds if `public`.

        Raise SettingError about a name or a domain that ROS cannot have, SinkError if DDS does not start.
        """
        # Cyclone DDS, which these import, is an extra.
        from cyclonedds.core import DDSException

        from ..ros import domain, messages

        self._where = f"ros:{domain.namespace(name)}" + "?public" * public
        self._messages = messages
        number = domain.domain()
        try:
            self._domain, participant = domain.join(number, public=public)
            self._grasp = domain.writer(participant, f"{name}/grasp", messages.String)
            self._preshape = domain.writer(participant, f"{name}/preshape", messages.JointTrajectory)
            self._angles = domain.writer(participant, f"{name}/angles", messages.JointState)
            self._health = domain.writer(participant, f"{name}/health", messages.String)
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
        self._string = cache(messages.PackedString)
        self._state: PackedAngles | None = None
        self._told: tuple[Preshape | None, int] = (None, 0)
        self._sent = self._lost = 0
        self._error = ""

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Publish the grasp type, the preshape if it is news to somebody, and the angles."""
        self._try(lambda: self._write(grasp, preshape, angles))

    def health(self, report: HealthReport) -> None:
        """Publish how the glove fares."""
        self._try(lambda: self._health.write(self._messages.String(json.encode(report).decode())))

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

    def _tell(self, preshape: Preshape) -> None:
        """Publish `preshape` unless everybody who listens was told it."""
        news = (preshape, self._preshape.get_publication_matched_status().total_count)
        if news != self._told:
            self._preshape.write(self._messages.trajectory(preshape))
            self._told = news

    def _packed(self, unix_us: int, angles: JointAngles) -> "PackedAngles":
        if self._state is None or self._state.names != angles.names:
            self._state = self._messages.PackedAngles(angles.names)
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


def _open(where: SinkPlace) -> Sink:
    try:
        return RosTopics(where.place, public="public" in where.options)
    except ImportError as reason:
        raise SinkError(f"ros:{where.place} needs Cyclone DDS: pip install 'thenar[ros]' ({reason})") from None


MEMBER = SinkKind(
    "ros", "/NAMESPACE", "topics of ROS 2 on this machine; with ?public others may read", _open, ("public",), rank=4
)
