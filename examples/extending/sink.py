"""A sink that another package brings: every grasp as a datagram of JSON. thenar run ... --sink udp:HOST:PORT"""

import socket

from thenar.drivers.errors import SettingError
from thenar.runtime.sinks import Sink, SinkKind, SinkPlace
from thenar.runtime.sinks.jsonl import encode


class Datagrams(Sink):
    """Sends whether or not anybody listens; no method waits, and none raises."""

    def __init__(self, where, address):
        """Send to `address`, a host and a port; messages call the sink `where`."""
        self.where, self.address = where, address
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)

    def publish(self, grasp, preshape, angles):
        """Send what was recognised, the preshape and the glove's angles, None where there are none."""
        self.attempt(lambda: self.socket.sendto(encode(grasp, preshape, angles), self.address))

    def close(self):
        """Close the socket."""
        self.socket.close()


def open_datagrams(where: SinkPlace) -> Sink:
    """Open the sink at HOST:PORT."""
    host, _, port = where.place.rpartition(":")
    if not host or not port.isdecimal():
        raise SettingError(f"{where.text} is no address: write it as udp:127.0.0.1:7777")
    return Datagrams(where.text, (host, int(port)))


MEMBER = SinkKind("udp", "HOST:PORT", "a datagram of JSON a grasp", open_datagrams)
