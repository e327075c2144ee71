"""A participant in the domain that ROS 2's nodes are in: those of this machine, unless others are let in."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant

_FORM = "<CycloneDDS><Domain>{}</Domain></CycloneDDS>"
# Behind all others. A reader that hangs would otherwise hold up every writer's end for a second.
_SETTINGS = _FORM.format("<Internal><WriterLingerDuration>100 ms</WriterLingerDuration></Internal>")
# Loopback has no multicast: participants look for each other at the ports of localhost.
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
    """Return the domain, where it is ours to end, and a participant in it.

    CYCLONEDDS_URI says which network is used, where it is set. Otherwise it is loopback alone unless `public`. Raises
    DDSException, and OSError where the system does not keep a socket to loopback.
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
        ours = None  # somebody in this process is in it already, with settings of their own
    return ours, DomainParticipant(number)


@contextmanager
def _kept_to_loopback() -> Iterator[None]:
    """Let the datagram sockets that are opened meanwhile receive from this machine alone.

    Cyclone DDS binds those that it receives with to all addresses, whatever interface it is given.
    """
    before = _sockets()
    yield
    for descriptor in set(_sockets().items()) - set(before.items()):
        with socket.socket(fileno=os.dup(descriptor[0])) as one:
            if one.type == socket.SOCK_DGRAM and one.family in (socket.AF_INET, socket.AF_INET6):
                one.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo")


def _sockets() -> dict[int, str]:
    """Return the sockets of this process: which descriptor is which socket."""
    found = {}
    for link in _DESCRIPTORS.iterdir():
        with suppress(OSError):  # closed meanwhile
            target = str(link.readlink())
            if target.startswith("socket:"):
                found[int(link.name)] = target
    return found
