"""Reads a list of ports again and again: the hot path, which allocates and decides as little as it can."""

from collections.abc import Sequence
from time import monotonic

from ..errors import DeviceError
from . import words
from .keeper import Keeper
from .node import Node, Run
from .ways import Group, Port, Way, cut


class Batching:
    """The way of a bus: all scans share what one of them has found out."""

    def __init__(self, way: Way) -> None:
        self.way = way


class Scan:
    """Ports in a fixed order, read by as few transfers as the adapter allows."""

    def __init__(self, node: Node, keeper: Keeper, batching: Batching, ports: Sequence[Port]) -> None:
        self._node = node
        self._keeper = keeper
        self._batching = batching
        self._ports = ports
        self._revision = -1
        self._way = batching.way
        self._groups: list[tuple[Group, Run]] = []

    def read(self) -> list[int | None]:
        """Return each port's answer, bit i being pin reading.pins[i]; None where the chip is absent or has failed.

        Every answer was read in this call. Raises DeviceError if the device node is gone; after `open` it works again.
        """
        keeper = self._keeper
        if monotonic() >= keeper.due:
            self._attend()
        if self._revision != keeper.revision or self._way is not self._batching.way:
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
                value = int.from_bytes(answer, "little")
                if 0 in answer or value & port.high != port.high:
                    answers[number] = self._doubt(port, answer)
                else:
                    answers[number] = value
        return answers

    def _attend(self) -> None:
        self._need_open()
        self._keeper.attend()

    def _need_open(self) -> None:
        if not self._node.is_open:
            raise DeviceError(f"{self._node.device} is not open: open the bus first")

    def _plan(self) -> None:
        self._need_open()
        self._revision, self._way = self._keeper.revision, self._batching.way
        groups = cut(self._ports, self._way)
        self._groups = [(group, self._node.prepare([port.query for _, port in group.ports])) for group in groups]

    def _one_by_one(self, group: Group, error: OSError) -> list[bytes | None]:
        """Read the ports of a transfer that failed each by itself; where batches are refused, ask less from now on."""
        if error.errno in words.REFUSED and self._way is self._batching.way:  # else it was lowered since `_plan`
            self._lower(len(group.ports) > 1)
        self._keeper.routes.forget()
        return [self._alone(port) for _, port in group.ports]

    def _lower(self, batch: bool) -> None:
        way = self._batching.way.lower() if batch else Way.SMBUS
        self._batching.way = way
        self._node.plain_i2c = way is not Way.SMBUS

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
        if port.believed != (answer, member.checked):
            self._keeper.feel()
            if member.present:
                self._keeper.check(member)
            again = self._alone(port)
            if again is None:
                return None
            port.believed = (again, member.checked)
            answer = again
        return int.from_bytes(answer, "little")
