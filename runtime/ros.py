"""ROS 2 by Eclipse Cyclone DDS (extra `ros`): its names and messages, and a participant in the domain of its nodes.

Messages have the names and the layout that ROS 2 uses, field by field as in their .msg files; a type pkg/Name is
pkg::msg::dds_::Name_ in DDS. They are final and keyless, and are sent as plain CDR (XCDR1), as rmw_cyclonedds and
rmw_fastrtps send theirs. A participant is on this machine only, unless it is public.
"""

import os
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from thenar.drivers.errors import SettingError
from thenar.drivers.extras import optional

from .published import Health, JointAngles, LiveGrasp, Preshape

with optional():
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.idl import make_idl_struct, types
    from cyclonedds.idl.annotations import final
    from cyclonedds.idl.types import byte, float32, float64, int32, uint8, uint32
    from cyclonedds.internal import load_cyclonedds
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

_sequence: Any = types.sequence  # Cyclone's says nothing to a type checker
# By the DDS name of a type. REP-2011: ROS 2 from Iron on expects it in the endpoint's user data, and warns if it is
# missing.
TYPE_HASHES: dict[str, str] = {}


def _message(name: str, type_hash: str = "", /, **fields: Any) -> Any:
    """Return the type of a message, a dataclass; only those that are sent by themselves need a hash."""
    package, _, kind = name.partition("/")
    made: Any = final(make_idl_struct(kind, f"{package}::msg::dds_::{kind}_", fields))
    TYPE_HASHES[made.__idl_typename__] = f"RIHS01_{type_hash}"
    return made


Time = _message("builtin_interfaces/Time", sec=int32, nanosec=uint32)
Duration = _message("builtin_interfaces/Duration", sec=int32, nanosec=uint32)
Header = _message("std_msgs/Header", stamp=Time, frame_id=str)
String = _message("std_msgs/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18", data=str)
# Positions in rad or m; what is unknown is empty.
JointState = _message(
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
JointTrajectory = _message(
    "trajectory_msgs/JointTrajectory",
    "179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e",
    header=Header,
    joint_names=_sequence[str],
    points=_sequence[JointTrajectoryPoint],
)
MultiArrayDimension = _message("std_msgs/MultiArrayDimension", label=str, size=uint32, stride=uint32)
MultiArrayLayout = _message("std_msgs/MultiArrayLayout", dim=_sequence[MultiArrayDimension], data_offset=uint32)
UInt8MultiArray = _message(
    "std_msgs/UInt8MultiArray",
    "5687e861b8d307a5e48b7515467ae7a5fc2daf805bd0ce6d8e9e604bade9f385",
    layout=MultiArrayLayout,
    data=_sequence[uint8],
)
Float32MultiArray = _message(
    "std_msgs/Float32MultiArray",
    "0599f6f85b4bfca379873a0b4375a0aca022156bd2d7021275d116ed1fa8bfe0",
    layout=MultiArrayLayout,
    data=_sequence[float32],
)
KeyValue = _message("diagnostic_msgs/KeyValue", key=str, value=str)
# Level 0 is fine, 1 a warning, 2 an error.
DiagnosticStatus = _message(
    "diagnostic_msgs/DiagnosticStatus",
    level=byte,
    name=str,
    message=str,
    hardware_id=str,
    values=_sequence[KeyValue],
)
DiagnosticArray = _message(
    "diagnostic_msgs/DiagnosticArray",
    "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    header=Header,
    status=_sequence[DiagnosticStatus],
)

LEVELS: dict[Health, int] = {"ok": 0, "changing": 0, "degraded": 1, "unknown": 2}


def segment(name: str, grasp: LiveGrasp) -> Any:
    """Return the prediction as the status of component `name`, stamped with its moment."""
    began_us = None if grasp.segment_us is None else grasp.unix_us - grasp.time_us + grasp.segment_us
    values = {
        "grasp": grasp.grasp,
        "probability": f"{grasp.probability:.6f}",
        "health": grasp.health,
        "state": grasp.state,
        "segment": str(grasp.segment),
        "segment_type": grasp.segment_type,
        "segment_probability": f"{grasp.segment_probability:.6f}",
        "segment_stamp": "" if began_us is None else f"{began_us / 1e6:.6f}",
        "candidate": grasp.candidate,
        "margin": str(grasp.margin),
        "lost": ", ".join(grasp.lost),
    }
    return _diagnosed(grasp.unix_us, LEVELS[grasp.health], name, grasp.grasp, values)


def _diagnosed(unix_us: int, level: int, name: str, message: str, values: dict[str, str]) -> Any:
    pairs = [KeyValue(key, value) for key, value in values.items()]
    return DiagnosticArray(_header(unix_us), [DiagnosticStatus(level, name, message, "", pairs)])


def joint_state(unix_us: int, angles: JointAngles) -> Any:
    """Return the glove's joints at a moment."""
    return JointState(_header(unix_us), list(angles.names), list(angles.positions_rad), [], [])


def _header(unix_us: int) -> Any:
    seconds, microseconds = divmod(unix_us, 1_000_000)
    return Header(Time(seconds, microseconds * 1000), "")


def trajectory(preshape: Preshape) -> Any:
    """Return a preshape as a trajectory of one point, to be started on arrival (a stamp of zero)."""
    seconds, rest = divmod(round(preshape.time_from_start_s * 1_000_000_000), 1_000_000_000)
    point = JointTrajectoryPoint(list(preshape.positions), [], [], [], Duration(seconds, rest))
    return JointTrajectory(Header(Time(0, 0), ""), list(preshape.joint_names), [point])


_DEPTH = 10
# History of a fast topic, for the time that a thread may be late.
_READ_DEPTH = 256
_UNLIMITED = -1
_MAX_DOMAIN = 232  # above it the ports of DDS would pass 65535
_MAX_LENGTH = 200

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


def namespace(name: str) -> str:
    """Return `name` if it is a valid namespace for topics, as "/thenar" or "/lab/left_hand". Raises SettingError."""
    fits = re.fullmatch(r"(?:/[A-Za-z][A-Za-z0-9_]*)+", name) and "__" not in name and len(name) <= _MAX_LENGTH
    if not fits:
        raise SettingError(f"ros:{name} is not a ROS name: write it as ros:/thenar, with letters, digits and single _")
    return name


def dds_topic(name: str) -> str:
    """Return the DDS name of the ROS topic `name`: "/thenar/grasp" is "rt/thenar/grasp"."""
    return f"rt{name}"


def domain() -> int:
    """Return the domain that the environment variable ROS_DOMAIN_ID names, or 0. Raises SettingError."""
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isdecimal() or int(text) > _MAX_DOMAIN:
        raise SettingError(f"ROS_DOMAIN_ID is {text!r}: set it to a whole number from 0 to {_MAX_DOMAIN}, or unset it")
    return int(text)


def writer(participant: DomainParticipant, name: str, kind: Any, *, kept: bool = False) -> Any:
    """Return a writer for messages of a kind on the ROS topic `name`: reliable, the last 10 kept, and volatile unless
    the newest is `kept` for late readers (transient local).
    """
    policies = [
        # Nobody may delay the writer: a message that does not fit is rejected at once.
        Policy.Reliability.Reliable(max_blocking_time=0),
        Policy.Durability.TransientLocal if kept else Policy.Durability.Volatile,
        Policy.DurabilityService(0, Policy.History.KeepLast(1), _UNLIMITED, _UNLIMITED, _UNLIMITED),
        Policy.History.KeepLast(_DEPTH),
        Policy.WriterDataLifecycle(autodispose=False),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        Policy.Userdata(f"typehash={TYPE_HASHES[kind.__idl_typename__]};".encode()),
    ]
    return DataWriter(participant, Topic(participant, dds_topic(name), kind), qos=Qos(*policies))


def reader(participant: DomainParticipant, name: str, kind: Any) -> Any:
    """Return a reader for messages of a kind on the ROS topic `name`, from reliable and best-effort writers."""
    policies = [
        Policy.Reliability.BestEffort,
        Policy.Durability.Volatile,
        Policy.History.KeepLast(_READ_DEPTH),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        Policy.Userdata(f"typehash={TYPE_HASHES[kind.__idl_typename__]};".encode()),
    ]
    return DataReader(participant, Topic(participant, dds_topic(name), kind), qos=Qos(*policies))
