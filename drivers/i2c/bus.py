"""An I2C bus with port expanders and converters: its chips, their health, and scans of their ports."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import monotonic, sleep

from ..closing import Closing
from ..errors import DeviceError, SettingError
from .chips import Conversion, Converter, Reading
from .node import MOST_MESSAGES, REFUSED, BatchMode, DeviceNode, Query, Run
from .supervisor import ChipSupervisor, PlacedChip, Route
from .tca9548a import ADDRESSES, CHANNELS


@dataclass(eq=False, slots=True)
class PlacedPort:
    """A port to read: a chip, and one of its readings.

    believed: a suspicious reply that was found to be right, and the number of checks of its chip by then.
    """

    member: PlacedChip
    reading: Reading
    believed: tuple[bytes, int] | None = None

    @property
    def slow(self) -> bool:
        """Whether it is a conversion that is begun and waited for before it is read."""
        return isinstance(self.reading, Conversion) and bool(self.reading.start)

    @property
    def query(self) -> Query:
        """What reads it."""
        return Query(self.member.address, self.reading.command, self.reading.length)

    def value(self, reply: bytes) -> int:
        """Return a reply as a number: the code of a converter, else bit i for pin reading.pins[i]."""
        chip = self.member.chip
        return chip.code(reply) if isinstance(chip, Converter) else int.from_bytes(reply, "little")

    def doubtful(self, reply: bytes) -> bool:
        """Return whether a reply looks as if SDA were held low or the chip had been reset."""
        if isinstance(self.reading, Conversion):
            return not any(reply)
        high = self.reading.high
        return 0 in reply or int.from_bytes(reply, "little") & high != high


# Ports, by their numbers in the scan, that one transfer reads, and the route to them.
Group = tuple[Route | None, tuple[tuple[int, PlacedPort], ...]]


def cut(ports: Sequence[PlacedPort], way: BatchMode) -> Iterator[Group]:
    """Return the groups that read the ports of all present chips, in order."""
    gathered: list[tuple[int, PlacedPort]] = []
    for number, port in enumerate(ports):
        if not port.member.present:
            continue
        if gathered and not _fits(port, [other for _, other in gathered], way):
            yield gathered[0][1].member.route, tuple(gathered)
            gathered = []
        gathered.append((number, port))
    if gathered:
        yield gathered[0][1].member.route, tuple(gathered)


def _fits(port: PlacedPort, gathered: Sequence[PlacedPort], way: BatchMode) -> bool:
    last = gathered[-1]
    if way is BatchMode.PORT or port.member.route != last.member.route or port.slow or last.slow:
        return False
    if way is BatchMode.CHIP and port.member is not last.member:
        return False
    return sum(other.query.messages for other in gathered) + port.query.messages <= MOST_MESSAGES


class Scan:
    """Ports in a fixed order, read by as few transfers as the adapter allows; a conversion that takes time is waited
    for.
    """

    def __init__(self, keeper: ChipSupervisor, ports: Sequence[PlacedPort]) -> None:
        self._node, self._keeper, self._ports = keeper.node, keeper, ports
        self._revision = -1
        self._way = self._node.way
        self._groups: list[tuple[Group, Run]] = []

    def read(self) -> list[int | None]:
        """Return each port's value: bit i is pin reading.pins[i], or the code of a conversion; None if the chip is
        absent or has failed.

        Every value was read in this call. Raises DeviceError if the device node is gone; after `open` it works again.
        """
        keeper = self._keeper
        if monotonic() >= keeper.due:
            self._need_open()
            keeper.attend()
        if self._revision != keeper.revision or self._way is not self._node.way:
            self._plan()
        replies: list[int | None] = [None] * len(self._ports)
        for (route, ports), run in self._groups:
            if not self._converted(ports[0][1]):
                continue
            try:
                if route is not None:
                    keeper.routes.select(route)
                found: Sequence[bytes | None] = run()
            except OSError as error:
                found = self._one_by_one(ports, error)
            for (number, port), reply in zip(ports, found, strict=True):
                if reply is None or not port.member.present:  # lost, maybe while its neighbours were read
                    continue
                replies[number] = self._doubt(port, reply) if port.doubtful(reply) else port.value(reply)
        return replies

    def _converted(self, port: PlacedPort) -> bool:
        """Begin a conversion that takes time and wait for it; return whether the port can be read."""
        reading, member = port.reading, port.member
        if not isinstance(reading, Conversion) or not reading.start:
            return True

        def start() -> bool:
            self._node.write(member.address, reading.start)
            return True

        begun = member.present and self._keeper.attempt(member, start)
        if begun:
            sleep(reading.us * 1e-6)
        return bool(begun)

    def _need_open(self) -> None:
        if not self._node.is_open:
            raise DeviceError(f"{self._node.device} is not open: open the bus first")

    def _plan(self) -> None:
        self._need_open()
        self._revision, self._way = self._keeper.revision, self._node.way
        groups = cut(self._ports, self._way)
        self._groups = [(group, self._node.prepare([port.query for _, port in group[1]])) for group in groups]

    def _one_by_one(self, ports: Sequence[tuple[int, PlacedPort]], error: OSError) -> list[bytes | None]:
        """Read the ports of a failed transfer one by one; if the adapter rejects batches, reduce them from then on."""
        # Else it was lowered since `_plan`, or is as low as can be.
        if error.errno in REFUSED and self._way is self._node.way and len(ports) > 1:
            self._node.way = self._way.lower()
        self._keeper.routes.forget()
        return [self._alone(port) for _, port in ports]

    def _alone(self, port: PlacedPort) -> bytes | None:
        if not port.member.present:
            return None
        return self._keeper.attempt(port.member, lambda: self._node.query(port.query))

    def _doubt(self, port: PlacedPort, reply: bytes) -> int | None:
        """Return a suspicious reply if it proves right, else the value read after recovery.

        On adapters that do not notice SDA held low, it reads as zeros, but so do eight closed switches. A 0 on a pin
        that the chip pulls up means that the chip was reset.
        """
        member = port.member
        if isinstance(port.reading, Conversion):
            believed = member.zeros == member.checked  # a chip has many channels, and most rest at 0 V
        else:
            believed = port.believed == (reply, member.checked)
        if not believed:
            self._keeper.check_bus_stuck()
            if member.present:
                self._keeper.check(member)
            again = self._alone(port)
            if again is None:
                return None
            port.believed, member.zeros = (again, member.checked), member.checked
            reply = again
        return port.value(reply)


class I2cBus(ChipSupervisor, Closing):
    """The chips on one device node, and the health of each. Use it from one thread at a time.

    Raises SettingError for two chips at one address, or an impossible mux.
    """

    def __init__(self, device: str, chips: Sequence[PlacedChip], *, check_every_s: float = 1.0) -> None:
        """Every check_every_s the registers of each chip and its mux are read back in one or two transfers, to detect
        resets.
        """
        _refuse_clashes(device, chips)
        super().__init__(DeviceNode(device), chips, check_every_s)

    def open(self) -> None:
        """Set up every chip and detect which batches the adapter supports. A missing chip is absent, not an error.

        Raises DeviceError if the device node cannot be used. May be called again afterwards, and at any time.
        """
        self.begin()
        # Registers, not ports, each twice: this tests batches of two chips and of two reads of one chip.
        control = [_control(member) for member in self.chips]
        trial = Scan(self, [port for port in control for _ in range(2)])
        for _ in BatchMode:
            trial.read()

    def prepare(self, ports: Sequence[PlacedPort]) -> Scan:
        """Return a reusable scan of ports, in this order."""
        return Scan(self, ports)

    @property
    def way(self) -> str:
        """A description of how reads are batched."""
        return self.node.way.value

    @property
    def transfers(self) -> int:
        """Number of transfers requested from the kernel."""
        return self.node.transfers

    def close(self) -> None:
        """Close the device node."""
        self.node.close()
        self.revision += 1


def _control(member: PlacedChip) -> PlacedPort:
    watched = member.chip.watched(member.used)
    if watched is None:
        return PlacedPort(member, member.chip.readings[0])
    return PlacedPort(member, Reading("registers", watched.data[:1], (-1,) * 8 * len(watched.expect)))


def _refuse_clashes(device: str, chips: Sequence[PlacedChip]) -> None:
    direct = {member.address for member in chips if member.route is None}
    seen: set[tuple[int, Route | None]] = set()
    for member in chips:
        member.chip.check_address(member.address)
        address, route = member.address, member.route
        if route and not (route.mux in ADDRESSES and route.channel in CHANNELS):
            raise SettingError(
                f"{device}: a tca9548a is at 0x70 to 0x77 and has channels 0 to 7, which excludes channel"
                f" {route.channel} at 0x{route.mux:02X}"
            )
        if (address, route) in seen or (route and address in direct):
            raise SettingError(f"{device}: two chips would respond at 0x{address:02X}: give one another address")
        seen.add((address, route))
