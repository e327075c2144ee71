"""Open Sound Control over UDP (extra `osc`), for programs of sound, light and stage: one bundle a grasp.

    PREFIX/grasp       the grasp type, its probability, the health, the state, and the number of the segment
    PREFIX/angle/NAME  the angle of a calibrated joint in rad; what OSC reserves in names is an underscore
    PREFIX/preshape    the name and the positions of a preshape, when it changes
    PREFIX/health      once a second, if requested: the glove's health, as JSON

PREFIX is /thenar unless the place ends in another one.
"""

import re
import socket
from collections.abc import Iterable
from typing import Any

from msgspec import json

from thenar.drivers.errors import SettingError
from thenar.drivers.extras import optional

from ..published import HealthReport, JointAngles, LiveGrasp, Preshape
from .base import Sink, SinkError, SinkKind, SinkPlace
from .sockets import resolve

_RATE_HZ = 50
_RESERVED = re.compile(r"[ #*,/?\[\]{}]|[^!-~]")
_PREFIX = re.compile(r"(?:/[^ #*,/?\[\]{}]+)+", re.ASCII)


class OscMessages(Sink):
    """Sends bundles to an address, whether or not anybody receives them."""

    def __init__(self, where: str, place: str) -> None:
        self.where = where
        host, slash, prefix = place.partition("/")
        self._prefix = f"/{prefix}" if slash else "/thenar"
        if not _PREFIX.fullmatch(self._prefix):
            raise SettingError(f"{where}: {self._prefix} is no OSC address: write it as /thenar")
        family, self._address = resolve(host, where, "osc:127.0.0.1:9000")
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._shown: Preshape | None = None

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Send a bundle of the grasp and the angles, with the preshape if it is another one."""
        sent: list[tuple[str, Iterable[Any]]] = [
            ("grasp", (grasp.grasp, grasp.probability, grasp.health, grasp.state, grasp.segment))
        ]
        for name, angle in () if angles is None else zip(angles.names, angles.positions_rad, strict=True):
            sent.append((f"angle/{_RESERVED.sub('_', name)}", (angle,)))
        if preshape is not None and preshape != self._shown:
            sent.append(("preshape", (preshape.name, *preshape.positions)))
            self._shown = preshape
        self.attempt(lambda: self._send(sent))

    def health(self, report: HealthReport) -> None:
        """Send the glove's health."""
        self.attempt(lambda: self._send([("health", (json.encode(report).decode(),))]))

    def _send(self, messages: Iterable[tuple[str, Iterable[Any]]]) -> None:
        from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
        from pythonosc.osc_message_builder import OscMessageBuilder

        bundle = OscBundleBuilder(IMMEDIATELY)
        for address, values in messages:
            message = OscMessageBuilder(f"{self._prefix}/{address}")
            for value in values:
                message.add_arg(value)
            bundle.add_content(message.build())
        self._socket.sendto(bundle.build().dgram, self._address)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def _open(where: SinkPlace) -> Sink:
    with optional(SinkError, where.text):
        import pythonosc.osc_bundle_builder  # noqa: F401
    return OscMessages(f"osc:{where.place}", where.place)


MEMBER = SinkKind("osc", "HOST:PORT[/PREFIX]", "bundles of Open Sound Control by UDP", _open, rate=_RATE_HZ, rank=8)
