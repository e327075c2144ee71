"""ROS 2 names, and a participant in the domain of its nodes: on this machine only, unless it is public."""

import os
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.internal import load_cyclonedds
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from thenar.drivers.errors import SettingError

from .messages import TYPE_HASHES

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
