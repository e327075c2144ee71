"""An I2C bus with port expanders and converters: which chips are there, how they do, and scans of their ports."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import monotonic, sleep

from ..closing import Closing
from ..errors import DeviceError, SettingError
from .chips import Chip, Conversion, Converter, Reading
from .keeper import Keeper, PlacedChip, Route
from .node import MOST_MESSAGES, REFUSED, Node, Query, Run, Way
from .tca9548a import ADDRESSES, CHANNELS


@dataclass(eq=False, slots=True)
class Port:
    """A port to read: whose, and how.

    believed: an answer that looked wrong and was found to be right, and how often its chip had been checked by then.
    """

    member: PlacedChip
    query: Query
    reading: Reading
    believed: tuple[bytes, int] | None = None

    def value(self, answer: bytes) -> int:
        """Return an answer as a number: of a converter its code, else bit i for pin reading.pins[i]."""
        chip = self.member.chip
        return chip.code(answer) if isinstance(chip, Converter) else int.from_bytes(answer, "little")

    def doubtful(self, answer: bytes) -> bool:
        """Return whether an answer looks as if SDA were held low, or the chip had been reset."""
        if isinstance(self.reading, Conversion):
            return not any(answer)
        high = self.reading.high
        return 0 in answer or int.from_bytes(answer, "little") & high != high


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


class Scan:
    """Ports in a fixed order, read by as few transfers as the adapter allows."""

    def __init__(self, node: Node, keeper: Keeper, ports: Sequence[Port]) -> None:
        self._node = node
        self._keeper = keeper
        self._ports = ports
        self._revision = -1
        self._way = node.way
        self._groups: list[tuple[Group, Run]] = []

    def read(self) -> list[int | None]:
        """Return each port's answer: bit i is pin reading.pins[i], or the code of a conversion; None where the chip is
        absent or has failed.

        Every answer was read in this call. Raises DeviceError if the device node is gone; after `open` it works again.
        """
        keeper = self._keeper
        if monotonic() >= keeper.due:
            self._attend()
        if self._revision != keeper.revision or self._way is not self._node.way:
            self._plan()
        answers: list[int | None] = [None] * len(self._ports)
        for group, run in self._groups:
            try:
                if group.route is not None:
                    keeper.routes.select(group.route)
                found: Sequence[bytes | None] = run()
            except OSError as error:
                found = self._one_by_one(group, error)
            for (number, port), answer in zip(group.ports, found, strict=True):
                if answer is None or not port.member.present:  # lost, maybe while its neighbours were read
                    continue
                answers[number] = self._doubt(port, answer) if port.doubtful(answer) else port.value(answer)
        return answers

    def _attend(self) -> None:
        self._need_open()
        self._keeper.attend()

    def _need_open(self) -> None:
        if not self._node.is_open:
            raise DeviceError(f"{self._node.device} is not open: open the bus first")

    def _plan(self) -> None:
        self._need_open()
        self._revision, self._way = self._keeper.revision, self._node.way
        groups = cut(self._ports, self._way)
        self._groups = [(group, self._node.prepare([port.query for _, port in group.ports])) for group in groups]

    def _one_by_one(self, group: Group, error: OSError) -> list[bytes | None]:
        """Read the ports of a transfer that failed each by itself; where batches are refused, ask less from now on."""
        if error.errno in REFUSED and self._way is self._node.way:  # else it was lowered since `_plan`
            self._node.way = self._way.lower() if len(group.ports) > 1 else Way.SMBUS
        self._keeper.routes.forget()
        return [self._alone(port) for _, port in group.ports]

    def _alone(self, port: Port) -> bytes | None:
        if not port.member.present:
            return None
        return self._keeper.attempt(port.member, lambda: self._node.query(port.query))

    def _doubt(self, port: Port, answer: bytes) -> int | None:
        """Return an answer that looks wrong only when it is right; else what is read once the reason is gone.

        A byte of zeros is what SDA held low reads as, on adapters that do not notice; it is also eight closed switches.
        A 0 where the chip pulls up tells that it was reset.
        """
        member = port.member
        if isinstance(port.reading, Conversion):
            believed = member.zeros == member.checked  # a chip has many channels, and most rest at 0 V
        else:
            believed = port.believed == (answer, member.checked)
        if not believed:
            self._keeper.feel()
            if member.present:
                self._keeper.check(member)
            again = self._alone(port)
            if again is None:
                return None
            port.believed, member.zeros = (again, member.checked), member.checked
            answer = again
        return port.value(answer)


class _Converting:
    """A converter of a scan: which of its steps are left, which one converts, and until when it is busy."""

    def __init__(self, node: Node, keeper: Keeper, member: PlacedChip) -> None:
        self._node, self._keeper, self._member = node, keeper, member
        self._conversions: dict[int, Conversion] = {}
        self._left: deque[int] = deque()
        self.converts: int | None = None
        # What a scan that ended early has begun is not stopped: the chip takes no other before it is over.
        self.until = 0.0

    def add(self, step: int, conversion: Conversion) -> None:
        """Take a step of the scan."""
        self._conversions[step] = conversion

    def restart(self) -> None:
        """Begin a scan."""
        self._left = deque(self._conversions)
        self.converts = None

    @property
    def pending(self) -> bool:
        """Whether something is left of it in this scan."""
        return self.converts is not None or bool(self._left)

    def begin(self) -> None:
        """Begin the next conversion, if one is left and none goes on. A chip that is absent has nothing to wait for."""
        if self.converts is not None or not self._left or monotonic() < self.until:
            return
        self.converts = step = self._left.popleft()
        conversion, member = self._conversions[step], self._member
        if member.present and self._keeper.attempt(member, lambda: self._start(conversion)):
            self.until = monotonic() + conversion.us * 1e-6

    def _start(self, conversion: Conversion) -> bool:
        self._node.write(self._member.address, conversion.start)
        return True

    def ready(self, step: int) -> bool:
        """Return whether this step can be read."""
        return self.converts == step and monotonic() >= self.until

    def was_read(self) -> None:
        """Go on with the next."""
        self.converts = None
        self.begin()


class Interleaved:
    """Groups of ports, read in their order; conversions that take time are groups of one port.

    Each converter begins its next conversion as soon as its last was read. While the next port of the scan converts,
    the first of the later ones that can be read is read ahead: so counts `thenar.runtime.scanning.timing`.
    """

    def __init__(self, node: Node, keeper: Keeper, groups: Sequence[Sequence[Port]]) -> None:
        self._scans = [Scan(node, keeper, group) for group in groups]
        slow: dict[PlacedChip, _Converting] = {}
        self._slow: dict[int, _Converting] = {}
        for step, group in enumerate(groups):
            for port in group:
                if isinstance(port.reading, Conversion) and port.reading.start:
                    chip = slow.setdefault(port.member, _Converting(node, keeper, port.member))
                    chip.add(step, port.reading)
                    self._slow[step] = chip
        self._chips = tuple(slow.values())

    def read(self) -> list[int | None]:
        """Return the answers of all ports, as `Scan.read` does."""
        return [answer for answers in self for answer in answers]

    def __iter__(self) -> Iterator[list[int | None]]:
        """Yield the answers of each group, as soon as it and all before it were read."""
        if not self._slow:
            for scan in self._scans:
                yield scan.read()
            return
        for chip in self._chips:
            chip.restart()
        left, found = list(range(len(self._scans))), dict[int, list[int | None]]()
        for step in range(len(self._scans)):
            while step not in found:
                able = self._able(left)
                found[able] = self._scans[able].read()
                left.remove(able)
                if able in self._slow:
                    self._slow[able].was_read()
            yield found.pop(step)

    def _able(self, left: Sequence[int]) -> int:
        """Return the first step that can be read, waiting where none can."""
        while True:
            for chip in self._chips:
                chip.begin()
            able = next((step for step in left if step not in self._slow or self._slow[step].ready(step)), None)
            if able is not None:
                return able
            sleep(max(0.0, min(chip.until for chip in self._chips if chip.pending) - monotonic()))


@dataclass(frozen=True, slots=True)
class ChipAt:
    """A chip in its place: straight on the bus, or on a channel of the TCA9548A at address `mux`; and the pins used."""

    chip: Chip
    address: int
    used: frozenset[int]
    mux: int | None = None
    channel: int | None = None


@dataclass(frozen=True, slots=True)
class PortRead:
    """One port to read: the chip's number on its bus, and one of its readings."""

    chip: int
    reading: Reading


class I2cBus(Closing):
    """The chips on one device node: `chips`, and how each is doing. To be used by one thread at a time.

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
        self.chips = tuple(PlacedChip(device, at.chip, at.address, at.used, _route(at)) for at in chips)
        self._node = Node(device)
        self._keeper = Keeper(self._node, self.chips, check_every_s)

    def open(self) -> None:
        """Set up every chip and find out what the adapter can batch. A chip that is missing is absent, and no error.

        Raises DeviceError if the device node cannot be used. May be called again after one, and at any time.
        """
        self._keeper.begin()
        # Registers, not ports, each twice: what batches of two chips and of two reads of one chip come to.
        control = [_control(member) for member in self.chips]
        trial = Scan(self._node, self._keeper, [port for port in control for _ in range(2)])
        for _ in Way:
            trial.read()

    def prepare(self, ports: Sequence[PortRead]) -> Scan:
        """Return what reads these ports, in this order, as often as it is asked."""
        return Scan(self._node, self._keeper, self._made(ports))

    def interleaved(self, groups: Sequence[Sequence[PortRead]]) -> Interleaved:
        """Return what reads groups of ports, in this order, conversions overlapped with what else the bus does.

        A conversion that takes time is a group of its own.
        """
        return Interleaved(self._node, self._keeper, [self._made(group) for group in groups])

    def _made(self, ports: Sequence[PortRead]) -> list[Port]:
        read = ((self.chips[port.chip], port.reading) for port in ports)
        return [Port(chip, Query(chip.address, one.command, one.length), one) for chip, one in read]

    @property
    def way(self) -> str:
        """How reads are batched, in words."""
        return self._node.way.value

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


_REGISTERS = Reading("registers", b"", ())


def _control(member: PlacedChip) -> Port:
    watched = member.watched
    if watched is None:
        reading = member.chip.readings[0]
        return Port(member, Query(member.address, reading.command, reading.length), reading)
    return Port(member, Query(member.address, watched.data[:1], len(watched.expect)), _REGISTERS)


def _route(at: ChipAt) -> Route | None:
    return None if at.mux is None or at.channel is None else Route(at.mux, at.channel)


def _refuse_clashes(device: str, chips: Sequence[ChipAt]) -> None:
    direct = {at.address for at in chips if at.mux is None}
    seen: set[tuple[int, Route | None]] = set()
    for at in chips:
        at.chip.check_address(at.address)
        address, route = at.address, _route(at)
        if (at.mux is None) != (at.channel is None) or (
            route and not (route.mux in ADDRESSES and route.channel in CHANNELS)
        ):
            raise SettingError(f"{device}: a tca9548a is at 0x70 to 0x77 and has channels 0 to 7; this is none: {at}")
        if (address, route) in seen or (route and address in direct):
            raise SettingError(f"{device}: two chips would answer at 0x{address:02X}: give one of them another address")
        seen.add((address, route))
