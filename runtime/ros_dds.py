"""ROS 2 by Eclipse Cyclone DDS (extra `ros`), without a ROS installation: its messages, and a participant.

Messages have the names and the layout that ROS 2 uses, field by field as in their .msg files; a type pkg/Name is
pkg::msg::dds_::Name_ in DDS. They are final and keyless, and are sent as plain CDR (XCDR1), as rmw_cyclonedds and
rmw_fastrtps send theirs. A participant is on this machine only, unless it is public.
"""

import os
import socket
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from thenar.drivers.errors import DeviceError
from thenar.drivers.extras import optional

from .ros import DEPTH, READ_DEPTH, Node

with optional():
    from cyclonedds.core import DDSException, ReadCondition, WaitSet
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.idl import make_idl_struct, types
    from cyclonedds.idl.annotations import final
    from cyclonedds.idl.types import float32, float64, int32, int64, uint8, uint32
    from cyclonedds.internal import load_cyclonedds
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

_sequence: Any = types.sequence  # Cyclone's says nothing to a type checker
TYPES: dict[str, Any] = {}
# REP-2011: ROS 2 from Iron on expects it in the endpoint's user data, and warns if it is missing.
TYPE_HASHES: dict[str, str] = {}


def _message(name: str, type_hash: str = "", /, **fields: Any) -> Any:
    """Return the type of a message, a dataclass; only those that are sent by themselves need a hash."""
    package, _, kind = name.partition("/")
    made: Any = final(make_idl_struct(kind, f"{package}::msg::dds_::{kind}_", fields))
    TYPES[name], TYPE_HASHES[name] = made, f"RIHS01_{type_hash}"
    return made


Time = _message("builtin_interfaces/Time", sec=int32, nanosec=uint32)
Duration = _message("builtin_interfaces/Duration", sec=int32, nanosec=uint32)
Header = _message("std_msgs/Header", stamp=Time, frame_id=str)
_message("std_msgs/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18", data=str)
# Positions in rad or m; what is unknown is empty.
_message(
    "sensor_msgs/JointState",
    "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    header=Header,
    name=_sequence[str],
    position=_sequence[float64],
    velocity=_sequence[float64],
    effort=_sequence[float64],
)
JointTrajectoryPoint = _message(
    "trajectory_msgs/JointTrajectoryPoint",
    positions=_sequence[float64],
    velocities=_sequence[float64],
    accelerations=_sequence[float64],
    effort=_sequence[float64],
    time_from_start=Duration,
)
# A stamp of zero in the header means: start now.
_message(
    "trajectory_msgs/JointTrajectory",
    "179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e",
    header=Header,
    joint_names=_sequence[str],
    points=_sequence[JointTrajectoryPoint],
)
MultiArrayDimension = _message("std_msgs/MultiArrayDimension", label=str, size=uint32, stride=uint32)
MultiArrayLayout = _message("std_msgs/MultiArrayLayout", dim=_sequence[MultiArrayDimension], data_offset=uint32)
_message(
    "std_msgs/UInt8MultiArray",
    "5687e861b8d307a5e48b7515467ae7a5fc2daf805bd0ce6d8e9e604bade9f385",
    layout=MultiArrayLayout,
    data=_sequence[uint8],
)
_message(
    "std_msgs/Float32MultiArray",
    "0599f6f85b4bfca379873a0b4375a0aca022156bd2d7021275d116ed1fa8bfe0",
    layout=MultiArrayLayout,
    data=_sequence[float32],
)
_message(
    "thenar_msgs/Grasp",
    "0b5789eb17a6e4b7a7199a37912d6174c762ca7a6d22d6a72da0591454f6047c",
    header=Header,
    grasp=str,
    probability=float64,
    health=str,
    state=str,
    segment=uint32,
    segment_type=str,
    segment_probability=float64,
    segment_stamp=Time,
    candidate=str,
    margin=int64,
    lost=_sequence[str],
)

_UNLIMITED = -1
_ANY = 0xFFFFFFFF  # samples, views and instances of all states

_FORM = "<CycloneDDS><Domain>{}</Domain></CycloneDDS>"
# Added after all others. A hanging reader would otherwise delay every writer's end by a second.
_SETTINGS = _FORM.format("<Internal><WriterLingerDuration>100 ms</WriterLingerDuration></Internal>")
# Loopback has no multicast: participants find each other at the ports of localhost.
_LOOPBACK = _FORM.format(
    """
    <General>
      <Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces><AllowMulticast>false</AllowMulticast>
    </General>
    <Discovery>
      <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>
      <Peers><Peer address="localhost"/></Peers>
    </Discovery>"""
)
_DESCRIPTORS = Path("/proc/self/fd")


def join(number: int, *, public: bool) -> tuple[Domain | None, DomainParticipant]:
    """Return the domain, if it is ours to end, and a participant in it.

    CYCLONEDDS_URI selects the network if it is set. Otherwise it is loopback only, unless `public`. Raises
    DDSException, and OSError if the system does not limit a socket to loopback.
    """
    users = os.environ.get("CYCLONEDDS_URI", "")
    if users or public:
        return _join(number, f"{users},{_SETTINGS}" if users else _SETTINGS)
    with _kept_to_loopback():
        return _join(number, f"{_LOOPBACK},{_SETTINGS}")


def _join(number: int, settings: str) -> tuple[Domain | None, DomainParticipant]:
    try:
        ours = Domain(number, settings)
    except DDSException as reason:
        if reason.code != DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
            raise
        ours = None  # this process has joined it already, with other settings
    participant = DomainParticipant(number)
    # Whatever its settings, each broken datagram writes a line to stderr: where nobody reads that, DDS would stop.
    load_cyclonedds().dds_set_log_mask(0)
    return ours, participant


@contextmanager
def _kept_to_loopback() -> Iterator[None]:
    """Make the datagram sockets that are opened in this context receive only from this machine.

    Cyclone DDS binds its receiving sockets to all addresses, whatever interface it is given.
    """
    before = _sockets()
    yield
    for descriptor in set(_sockets().items()) - set(before.items()):
        with socket.socket(fileno=os.dup(descriptor[0])) as one:
            if one.type == socket.SOCK_DGRAM and one.family in (socket.AF_INET, socket.AF_INET6):
                one.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo")


def _sockets() -> dict[int, str]:
    """Return the sockets of this process: the socket of each descriptor."""
    found = {}
    for link in _DESCRIPTORS.iterdir():
        with suppress(OSError):  # closed meanwhile
            target = str(link.readlink())
            if target.startswith("socket:"):
                found[int(link.name)] = target
    return found


class DdsNode(Node):
    """A participant in the domain of ROS's nodes."""

    def __init__(self, number: int, *, public: bool) -> None:
        self._participant: Any
        try:
            self._domain, self._participant = join(number, public=public)
        except DDSException as reason:
            advice = "Check CYCLONEDDS_URI, and the network interfaces that it names."
            raise DeviceError(f"in domain {number}: {reason} {advice}") from None
        except OSError as reason:
            need = "That takes Linux 5.7 or newer; ?public lets other machines read"
            raise DeviceError(f"for this machine alone: {reason.strerror}. {need}") from None
        self._writers: list[Any] = []
        self._reader: Any = None
        self._waiting: Any = None

    def kind(self, name: str) -> Any:
        """Return the type."""
        return TYPES[name]

    def writer(self, topic: str, kind: str, *, kept: bool = False) -> Callable[[Any], object]:
        """Return what writes messages of this type."""
        policies = [
            # Nobody may delay the writer: a message that does not fit is rejected at once.
            Policy.Reliability.Reliable(max_blocking_time=0),
            Policy.Durability.TransientLocal if kept else Policy.Durability.Volatile,
            Policy.DurabilityService(0, Policy.History.KeepLast(1), _UNLIMITED, _UNLIMITED, _UNLIMITED),
            Policy.History.KeepLast(DEPTH),
            Policy.WriterDataLifecycle(autodispose=False),
        ]
        made = DataWriter(self._participant, self._topic(topic, kind), qos=_qos(kind, *policies))
        self._writers.append(made)
        return made.write

    def readers(self) -> int:
        """Return the number of readers of the first topic that is written."""
        return self._writers[0].get_publication_matched_status().current_count if self._writers else 0

    def subscribe(self, topic: str, kind: str) -> None:
        """Let `read` return the messages of a topic."""
        policies = Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(READ_DEPTH)
        try:
            made = DataReader(self._participant, self._topic(topic, kind), qos=_qos(kind, *policies))
            self._waiting = WaitSet(self._participant)
            self._waiting.attach(ReadCondition(made, _ANY))
        except DDSException as reason:
            raise DeviceError(f"with {topic}: {reason}") from None
        self._reader = made

    def read(self, timeout_s: float) -> list[tuple[Any, Hashable]]:
        """Return the messages that came, and who sent each."""
        try:
            self._waiting.wait(timeout=max(1, round(timeout_s * 1e9)))
            samples = self._reader.take(N=READ_DEPTH)
        except DDSException as reason:
            raise DeviceError(str(reason)) from None
        # Others say that a writer has gone.
        return [(one, one.sample_info.publication_handle) for one in samples if one.sample_info.valid_data]

    def _topic(self, name: str, kind: str) -> Any:
        return Topic(self._participant, f"rt{name}", TYPES[kind])

    def close(self) -> None:
        """Leave the domain."""
        # Each entity ends with its last name; the domain, which ends all that is left in it, goes last.
        self._writers.clear()
        self._reader = self._waiting = self._participant = None
        self._domain = None


def _qos(kind: str, *policies: Any) -> Qos:
    return Qos(
        *policies,
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        Policy.Userdata(f"typehash={TYPE_HASHES[kind]};".encode()),
    )
