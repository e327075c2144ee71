"""An I2C bus with port expanders: which chips are there, how they do, and scans of their ports."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from ..errors import SettingError
from .chip import Chip, Reading
from .keeper import Keeper
from .member import ChipState, Member
from .node import Node, Query
from .routes import Route
from .scan import Batching, Scan
from .tca9548a import ADDRESSES, CHANNELS
from .ways import Port, Way


@dataclass(frozen=True, slots=True)
class ChipAt:
    """A chip in its place: straight on the bus, or on a channel of the TCA9548A at address `mux`; and the pins used."""

    chip: Chip
    used: frozenset[int]
    mux: int | None = None
    channel: int | None = None


@dataclass(frozen=True, slots=True)
class PortRead:
    """One port to read: the chip's number on its bus, and one of its readings."""

    chip: int
    reading: Reading


class I2cBus:
    """The chips on one device node. To be used by one thread at a time.

    Raises SettingError for two chips that would answer at one address, or a mux that cannot be.
    """

    def __init__(
        self, device: str, chips: Sequence[ChipAt], *, clock_hz: int = 100_000, check_every_s: float = 1.0
    ) -> None:
        """clock_hz is what the bus runs at, which the adapter's driver alone can set; it is kept for those who ask.

        Every check_every_s each chip's registers and its mux are read back, to notice resets: one transfer or two.
        """
        self.device, self.clock_hz = device, clock_hz
        _refuse_clashes(device, chips)
        self._members = tuple(Member(device, at.chip, at.used, _route(at)) for at in chips)
        self._node = Node(device)
        self._keeper = Keeper(self._node, self._members, check_every_s)
        self._batching = Batching(Way.CHANNEL)

    def open(self) -> None:
        """Set up every chip and find out what the adapter can batch. A chip that is missing is absent, and no error.

        Raises DeviceError if the device node cannot be used. May be called again after one, and at any time.
        """
        self._keeper.begin()
        self._batching.way = Way.CHANNEL if self._node.plain_i2c else Way.SMBUS
        # Registers, not ports, each twice: what batches of two chips and of two reads of one chip come to.
        control = [_control(member) for member in self._members]
        trial = Scan(self._node, self._keeper, self._batching, [port for port in control for _ in range(2)])
        for _ in Way:
            trial.read()

    def prepare(self, ports: Sequence[PortRead]) -> Scan:
        """Return what reads these ports, in this order, as often as it is asked."""
        return Scan(self._node, self._keeper, self._batching, [self._port(port) for port in ports])

    @property
    def chips(self) -> tuple[ChipState, ...]:
        """How each chip is doing."""
        return tuple(member.state for member in self._members)

    @property
    def way(self) -> str:
        """How reads are batched, in words."""
        return self._batching.way.value

    @property
    def trouble(self) -> str:
        """What is wrong with the bus as a whole and what to do about it; "" if nothing is."""
        return self._keeper.trouble

    @property
    def transfers(self) -> int:
        """How many transfers were asked of the kernel."""
        return self._node.transfers

    def close(self) -> None:
        """Close the device node."""
        self._node.close()
        self._keeper.revision += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _port(self, port: PortRead) -> Port:
        member = self._members[port.chip]
        reading = port.reading
        return Port(member, Query(member.chip.address, reading.command, reading.length), reading.high)


def _control(member: Member) -> Port:
    watched = member.watched
    if watched is None:
        reading = member.chip.readings[0]
        return Port(member, Query(member.chip.address, reading.command, reading.length), 0)
    return Port(member, Query(member.chip.address, watched.data[:1], len(watched.expect)), 0)


def _route(at: ChipAt) -> Route | None:
    return None if at.mux is None or at.channel is None else Route(at.mux, at.channel)


def _refuse_clashes(device: str, chips: Sequence[ChipAt]) -> None:
    direct = {at.chip.address for at in chips if at.mux is None}
    seen: set[tuple[int, Route | None]] = set()
    for at in chips:
        address, route = at.chip.address, _route(at)
        if (at.mux is None) != (at.channel is None) or (route and not _possible(route)):
            raise SettingError(f"{device}: a tca9548a is at 0x70 to 0x77 and has channels 0 to 7; this is none: {at}")
        if (address, route) in seen or (route and address in direct):
            raise SettingError(f"{device}: two chips would answer at 0x{address:02X}: give one of them another address")
        seen.add((address, route))


def _possible(route: Route) -> bool:
    return route.mux in ADDRESSES and route.channel in CHANNELS
