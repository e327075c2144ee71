"""How reads are batched into transfers: as many as the adapter's driver lets through, in the order they stand in."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

from .member import Member
from .node import MOST_MESSAGES, Query
from .routes import Route


class Way(Enum):
    """From the best to what always works.

    i2c-gpio takes any batch; designware (Raspberry Pi 5, many PCs) one address a transfer, else EINVAL; bcm2835
    (Raspberry Pi 0 to 4) one read a transfer, else EOPNOTSUPP; adapters without I2C_RDWR do SMBus only.
    """

    CHANNEL = "all ports that no mux is switched between, in one transfer"
    CHIP = "all ports of a chip in one transfer"
    PORT = "a transfer for every port"
    SMBUS = "an SMBus transfer for every port"

    def lower(self) -> "Way":
        """Return the next that asks less of the adapter; of the last, itself."""
        ways = list(Way)
        return ways[min(ways.index(self) + 1, len(ways) - 1)]


@dataclass(eq=False, slots=True)
class Port:
    """A port to read: whose, how, and which bits of the answer a chip in order keeps at 1.

    believed: an answer that looked wrong and was found to be right, and how often its chip had been checked by then.
    """

    member: Member
    query: Query
    high: int
    believed: tuple[bytes, int] | None = None


@dataclass(frozen=True, slots=True)
class Group:
    """Ports, by their numbers in the scan, that one transfer reads."""

    route: Route | None
    ports: tuple[tuple[int, Port], ...]


def cut(ports: Sequence[Port], way: Way) -> Iterator[Group]:
    """Return the groups that read the ports of the chips that are there, in their order."""
    gathered: list[tuple[int, Port]] = []
    for number, port in enumerate(ports):
        if not port.member.present:
            continue
        if gathered and not _fits(port, [other for _, other in gathered], way):
            yield Group(gathered[0][1].member.route, tuple(gathered))
            gathered = []
        gathered.append((number, port))
    if gathered:
        yield Group(gathered[0][1].member.route, tuple(gathered))


def _fits(port: Port, gathered: Sequence[Port], way: Way) -> bool:
    last = gathered[-1]
    if way in (Way.PORT, Way.SMBUS) or port.member.route != last.member.route:
        return False
    if way is Way.CHIP and port.member is not last.member:
        return False
    return sum(other.query.messages for other in gathered) + port.query.messages <= MOST_MESSAGES
