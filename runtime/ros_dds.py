"""ROS 2 by Eclipse Cyclone DDS (extra `ros`), without a ROS installation: its messages, and a participant.

Messages have the names and the layout that ROS 2 uses, field by field as in their .msg files; a type pkg/Name is
pkg::msg::dds_::Name_ in DDS. They are final and keyless, and are sent as plain CDR (XCDR1), as rmw_cyclonedds and
rmw_fastrtps send theirs. A participant is on this machine only, unless it is public.
"""

import os
import socket
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

from thenar.drivers.errors import DeviceError
from thenar.drivers.extras import optional

from .ros import DEPTH, PACKAGE, READ_DEPTH, Read

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
_PLAIN = {"string": str, "float32": float32, "float64": float64, "int32": int32, "int64": int64}
_PLAIN |= {"uint8": uint8, "uint32": uint32}
# Their .msg files, and type hashes of those that are sent by themselves. Positions are in rad or m; what is unknown is
# empty; a stamp of zero in a trajectory's header means: start now.
_MESSAGES = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/String": "string data",
    "sensor_msgs/JointState": """
        std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort""",
    "trajectory_msgs/JointTrajectoryPoint": """
        float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\nfloat64[] effort
        builtin_interfaces/Duration time_from_start""",
    "trajectory_msgs/JointTrajectory": """
        std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint[] points""",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
    "std_msgs/UInt8MultiArray": "std_msgs/MultiArrayLayout layout\nuint8[] data",
    "std_msgs/Float32MultiArray": "std_msgs/MultiArrayLayout layout\nfloat32[] data",
    "thenar_msgs/Grasp": (PACKAGE / "msg" / "Grasp.msg").read_text(encoding="utf-8"),
}
# REP-2011: ROS 2 from Iron on expects it in the endpoint's user data, and warns if it is missing.
TYPE_HASHES = {
    "std_msgs/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "sensor_msgs/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "trajectory_msgs/JointTrajectory": "179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e",
    "std_msgs/UInt8MultiArray": "5687e861b8d307a5e48b7515467ae7a5fc2daf805bd0ce6d8e9e604bade9f385",
    "std_msgs/Float32MultiArray": "0599f6f85b4bfca379873a0b4375a0aca022156bd2d7021275d116ed1fa8bfe0",
    "thenar_msgs/Grasp": "0b5789eb17a6e4b7a7199a37912d6174c762ca7a6d22d6a72da0591454f6047c",
}
TYPES: dict[str, Any] = {}
for _name, _text in _MESSAGES.items():
    _fields = {}
    for _kind, _field in (line.split() for line in _text.splitlines() if line.strip() and not line.startswith("#")):
        _type = (_PLAIN | TYPES)[_kind.removesuffix("[]")]
        _fields[_field] = _sequence[_type] if _kind.endswith("[]") else _type
    _package, _, _short = _name.partition("/")
    TYPES[_name] = final(make_idl_struct(_short, f"{_package}::msg::dds_::{_short}_", _fields))

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


def join(number: int, settings: str) -> tuple[Domain | None, Any]:
    """Return the domain, if it is ours to end, and a participant in it."""
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
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # closed meanwhile
            target = str(link.readlink())
            if target.startswith("socket:"):
                found[int(link.name)] = target
    return found


class DdsNode:
    """A participant in the domain of ROS's nodes.

    CYCLONEDDS_URI selects the network if it is set. Otherwise it is loopback only, unless `public`.
    """

    def __init__(self, number: int, *, public: bool) -> None:
        users = os.environ.get("CYCLONEDDS_URI", "")
        network = users or ("" if public else _LOOPBACK)
        try:
            with nullcontext() if users or public else _kept_to_loopback():
                self._domain, self._participant = join(number, f"{network},{_SETTINGS}".lstrip(","))
        except DDSException as reason:
            advice = "Check CYCLONEDDS_URI, and the network interfaces that it names."
            raise DeviceError(f"in domain {number}: {reason} {advice}") from None
        except OSError as reason:
            need = "That takes Linux 5.7 or newer; ?public lets other machines read"
            raise DeviceError(f"for this machine alone: {reason.strerror}. {need}") from None

    def kind(self, name: str) -> Any:
        """Return the type."""
        return TYPES[name]

    def writer(self, topic: str, kind: str, *, kept: bool = False) -> Callable[[Any], object]:
        """Return a function that writes messages of this type."""
        policies = [
            # Nobody may delay the writer: a message that does not fit is rejected at once.
            Policy.Reliability.Reliable(max_blocking_time=0),
            Policy.Durability.TransientLocal if kept else Policy.Durability.Volatile,
            Policy.DurabilityService(0, Policy.History.KeepLast(1), _UNLIMITED, _UNLIMITED, _UNLIMITED),
            Policy.History.KeepLast(DEPTH),
            Policy.WriterDataLifecycle(autodispose=False),
        ]
        with _failing(f"with {topic}"):
            return DataWriter(self._participant, self._topic(topic, kind), qos=_qos(kind, *policies)).write

    def reader(self, topic: str, kind: str) -> Read:
        """Return a function that reads messages of this type."""
        policies = Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(READ_DEPTH)
        with _failing(f"with {topic}"):
            made = DataReader(self._participant, self._topic(topic, kind), qos=_qos(kind, *policies))
            waiting = WaitSet(self._participant)
            waiting.attach(ReadCondition(made, _ANY))

        def read(timeout_s: float) -> list[tuple[Any, Hashable]]:
            with _failing(f"reading {topic}"):
                waiting.wait(timeout=max(1, round(timeout_s * 1e9)))
                samples = made.take(N=READ_DEPTH)
            # Others say that a writer has gone.
            return [(one, one.sample_info.publication_handle) for one in samples if one.sample_info.valid_data]

        return read

    def _topic(self, name: str, kind: str) -> Any:
        return Topic(self._participant, f"rt{name}", TYPES[kind])

    def close(self) -> None:
        """Leave the domain."""
        # Each entity ends with its last name; the domain, which ends all that is left in it, goes last.
        self._participant = None
        self._domain = None


@contextmanager
def _failing(what: str) -> Iterator[None]:
    """Turn an error of Cyclone DDS into a DeviceError that says what has failed."""
    try:
        yield
    except DDSException as reason:
        raise DeviceError(f"{what}: {reason}") from None


def _qos(kind: str, *policies: Any) -> Qos:
    return Qos(
        *policies,
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        Policy.Userdata(f"typehash=RIHS01_{TYPE_HASHES[kind]};".encode()),
    )
