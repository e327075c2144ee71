"""Serves emulated I2C buses as device nodes through umockdev, controlled by JSON lines on stdin and stdout.

It is started by `umockdev-wrapper /usr/bin/python3 -I`: it needs the system's Python, which has PyGObject, and no other
package. Each line in is [verb, arguments...] of `EmulationServer`; each line out is the reply.
"""

import errno
import importlib
import json
import struct
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gi

gi.require_version("UMockdev", "1.0")
from gi.repository import GLib, UMockdev  # noqa: E402

from ..spi.chips.base import SpiModel  # noqa: E402
from .i2c_wire import FUNCTIONS, I2C_BLOCK, Adapter, Message, Station, TransferFault, Wire  # noqa: E402

I2C_SLAVE, I2C_SLAVE_FORCE, I2C_FUNCS, I2C_RDWR, I2C_SMBUS = 0x703, 0x706, 0x705, 0x707, 0x720
_READS = 0x0001
_MESSAGE = struct.Struct("=HHHxxQ")
SPI_MODE, SPI_SPEED, SPI_MESSAGE = 0x40016B01, 0x40046B04, 0x40006B00
_SPI_TRANSFER = struct.Struct("=QQIIHBBBBBB")
# Sleep this much less than the wait, then spin: a plain sleep ends late by about this time.
_SPIN_S = 100e-6


class EmulatedNode(ABC):
    """A device node. The handler runs in umockdev's thread; `lock` separates it from the commands."""

    def __init__(self, testbed: Any, device: str, number: str, subsystem: str) -> None:
        self.lock = threading.Lock()
        self._clients: set[int] = set()  # clients that opened the node after its last plugging
        self._strangers: set[int] = set()  # clients that had it open when it was unplugged
        self._handler = UMockdev.IoctlBase()
        self._handler.connect("handle-ioctl", self._on_ioctl)
        self._handler.connect("client-vanished", self._forget)
        name = device.removeprefix("/dev/")
        sysfs = f"/devices/platform/{name}.{subsystem}/{name}/{subsystem}/{name}"
        testbed.add_from_string(f"P: {sysfs}\nN: {name}\nE: SUBSYSTEM={subsystem}\nE: DEVNAME={device}\n{number}")
        testbed.attach_ioctl(device, self._handler)
        self._path = Path(testbed.get_root_dir() + device)
        self._away = self._path.with_name(f".{name}")

    @abstractmethod
    def show(self, levels: list[int]) -> None:
        """Set the pins of all its chips."""

    @abstractmethod
    def counters(self) -> dict[str, Any]:
        """Return the traffic counts."""

    @abstractmethod
    def _do(self, client: Any) -> int:
        """Execute a client's request; raises OSError."""

    @abstractmethod
    def _spent_s(self) -> float:
        """Return the busy time of the wire since the start; 0 for an unpaced one."""

    def unplug(self) -> None:
        """Remove the node; clients that have it open get ENODEV from now on."""
        if not self._away.is_symlink():
            self._path.rename(self._away)
        self._strangers |= self._clients
        self._clients.clear()

    def plug(self) -> None:
        """Bring the node back for clients that open it from now on."""
        if self._away.is_symlink():
            self._away.rename(self._path)

    def _on_ioctl(self, _: Any, client: Any) -> bool:
        start = time.monotonic()
        reply = (-1, errno.EIO)  # on any error: a client without a reply would wait forever
        try:
            with self.lock:
                before = self._spent_s()
                reply = self._reply(client)
                took_s = self._spent_s() - before
            _wait_until(start + took_s)
        except (GLib.Error, AttributeError):
            return True  # the client was killed during its call: a reply would end this process
        except BaseException:
            client.complete(*reply)
            raise
        client.complete(*reply)
        return True

    def _reply(self, client: Any) -> tuple[int, int]:
        try:
            self._admit(hash(client))
            return self._do(client), 0
        except OSError as error:
            return -1, error.errno or errno.EIO

    def _forget(self, _: Any, client: Any) -> None:
        with self.lock:
            self._clients.discard(hash(client))
            self._strangers.discard(hash(client))

    def _admit(self, client: int) -> None:
        if client in self._strangers:
            raise OSError(errno.ENODEV, "unplugged")
        self._clients.add(client)


class I2cNode(EmulatedNode):
    """One /dev/i2c-N."""

    def __init__(self, testbed: Any, device: str, adapter: Adapter, paced: bool) -> None:
        minor = device.rpartition("-")[2]
        super().__init__(testbed, device, f"E: MAJOR=89\nE: MINOR={minor}\n", "i2c-dev")
        self.adapter, self._paced = adapter, paced
        self._addresses: dict[int, int] = {}

    def show(self, levels: list[int]) -> None:
        """Set the pins of all its chips."""
        for station, value in zip(self.adapter.wire.stations, levels, strict=True):
            station.device.levels = value

    def counters(self) -> dict[str, Any]:
        """Return the traffic counts."""
        wire = self.adapter.wire
        return {
            "calls": self.adapter.calls,
            "transfers": wire.transfers,
            "scl_periods": wire.scl_periods,
            "traffic": [(*place, count) for place, count in wire.traffic.items()],
        }

    def _spent_s(self) -> float:
        wire = self.adapter.wire
        return wire.duration_s(wire.scl_periods, wire.transfers) if self._paced else 0.0

    def _do(self, client: Any) -> int:
        request, arg = client.get_request(), client.get_arg()
        self.adapter.calls += 1
        if request in (I2C_SLAVE, I2C_SLAVE_FORCE):
            address = struct.unpack("L", bytes(arg.retrieve()))[0] & 0x7F
            if request == I2C_SLAVE:
                self.adapter.slave(address)
            self._addresses[hash(client)] = address
            return 0
        if request == I2C_FUNCS:
            arg.resolve(0, 8).update(0, struct.pack("L", FUNCTIONS))
            return 0
        if request == I2C_RDWR:
            return self._rdwr(arg.resolve(0, 16))
        if request == I2C_SMBUS:
            return self._smbus(arg.resolve(0, 16), self._addresses.get(hash(client), 0))
        raise OSError(errno.ENOTTY, "no such request")

    def _rdwr(self, data: Any) -> int:
        _, count = struct.unpack_from("=QI", bytes(data.retrieve()))
        if count > 42:
            raise OSError(errno.EINVAL, "too many messages")
        table = data.resolve(0, _MESSAGE.size * count)
        messages, buffers = [], []
        for number, (address, flags, length, _) in enumerate(_MESSAGE.iter_unpack(bytes(table.retrieve()))):
            buffer = table.resolve(_MESSAGE.size * number + 8, length)
            if flags & _READS:
                messages.append(Message(address, None, length))
                buffers.append((number, buffer))
            else:
                messages.append(Message(address, bytes(buffer.retrieve())))
        replies = self.adapter.rdwr(messages)
        for number, buffer in buffers:
            buffer.update(0, replies[number])
        return int(count)

    def _smbus(self, data: Any, address: int) -> int:
        reads, command, size = struct.unpack_from("=BBxxI", bytes(data.retrieve()))
        pointer = data.resolve(8, 34) if size else None
        content = bytes(pointer.retrieve()) if pointer is not None else b""
        block = content[1 : 1 + content[0]] if size == I2C_BLOCK else content[: max(0, size - 1)]
        reply = self.adapter.smbus(address, bool(reads), command, size, block)
        if reads and pointer is not None:
            pointer.update(1 if size == I2C_BLOCK else 0, reply)
        return 0


class SpiNode(EmulatedNode):
    """One /dev/spidevB.C with a chip behind it, at the clock that its client requests; None: no chip."""

    def __init__(self, testbed: Any, device: str, chip: SpiModel | None) -> None:
        super().__init__(testbed, device, "E: MAJOR=153\nE: MINOR=0\n", "spidev")
        self._chip, self._spent, self._calls, self._transfers, self._bytes = chip, 0.0, 0, 0, 0

    def show(self, levels: list[int]) -> None:
        """Set the codes at the chip's channels."""
        if self._chip is not None:
            (self._chip.levels,) = levels

    def counters(self) -> dict[str, Any]:
        """Return the traffic counts."""
        return {"calls": self._calls, "transfers": self._transfers, "scl_periods": 8 * self._bytes, "traffic": []}

    def _spent_s(self) -> float:
        return self._spent

    def _do(self, client: Any) -> int:
        request, arg = client.get_request(), client.get_arg()
        if request in (SPI_MODE, SPI_SPEED):
            return 0
        size = request >> 16 & 0x3FFF
        if request & 0xC000FFFF != SPI_MESSAGE or not size or size % _SPI_TRANSFER.size:
            raise OSError(errno.ENOTTY, "no such request")
        self._calls += 1
        table = arg.resolve(0, size)
        total = 0
        for number, (_, _, length, hz, *_) in enumerate(_SPI_TRANSFER.iter_unpack(bytes(table.retrieve()))):
            at = _SPI_TRANSFER.size * number
            sent = bytes(table.resolve(at, length).retrieve())
            came = b"\xff" * length if self._chip is None else self._chip.transfer(sent)
            table.resolve(at + 8, length).update(0, came)
            self._transfers, self._bytes, total = self._transfers + 1, self._bytes + length, total + length
            self._spent += 8 * length / hz
        return total


class EmulationServer:
    """The verbs of lines on stdin; a chip is its number on its bus. SPI devices follow the buses."""

    def __init__(self, testbed: Any, buses: list[dict[str, Any]]) -> None:
        self._nodes = [_node(testbed, **bus) for bus in buses]

    def levels(self, every: list[list[int]]) -> None:
        """Set the pins of all chips of all buses."""
        for node, values in zip(self._nodes, every, strict=True):
            with node.lock:
                node.show(values)

    def unplug(self, bus: int) -> None:
        """Remove the adapter."""
        with self._nodes[bus].lock:
            self._nodes[bus].unplug()

    def plug(self, bus: int) -> None:
        """Bring the adapter back."""
        with self._nodes[bus].lock:
            self._nodes[bus].plug()

    def fault(self, bus: int, name: str, arguments: list[Any]) -> None:
        """Inject a fault: see `i2c.EmulatedI2c`, which has a method for each."""
        node = self._nodes[bus]
        assert isinstance(node, I2cNode)
        with node.lock:
            _FAULTS[name](node.adapter, *arguments)

    def counters(self, bus: int) -> dict[str, Any]:
        """Return the traffic counts."""
        node = self._nodes[bus]
        with node.lock:
            return node.counters()


def _node(
    testbed: Any, device: str, chips: list[dict[str, Any]], clock_hz: int = 0, adapter: str = "", paced: bool = True
) -> EmulatedNode:
    """Return a bus, or, without an adapter, an SPI device; no chip there is a chip without a model."""
    if not adapter:
        (chip,) = chips
        place = chip.pop("model")
        return SpiNode(testbed, device, None if place is None else _model(*place)(**chip))
    stations = [Station(_model(*chip.pop("model")), **chip) for chip in chips]
    return I2cNode(testbed, device, Adapter(Wire(stations, clock_hz), adapter), paced)


_FAULTS: dict[str, Callable[..., None]] = {
    "error": lambda adapter, *fault: adapter.faults.append(TransferFault(*fault)),
    "absent": lambda adapter, chip, absent: setattr(adapter.wire.stations[chip], "absent", absent),
    "absent_mux": lambda adapter, mux: adapter.wire.absent_muxes.add(mux),
    "become": lambda adapter, chip, model: adapter.wire.stations[chip].become(_model(*model)),
    "reset": lambda adapter, chip: adapter.wire.stations[chip].device.reset(),
    "poke": lambda adapter, chip, register, value: adapter.wire.stations[chip].device.poke(register, value),
    "poke_mux": lambda adapter, mux, value: adapter.wire.muxes[mux].poke(0, value),
    "claim": lambda adapter, address: adapter.claimed.add(address),
    "stick": Adapter.stick,
    "heal": Adapter.heal,
}


def _model(folder: str, module: str, name: str) -> Any:
    """Return the class `name` of a chip's module, imported from `folder`."""
    if folder not in sys.path:
        sys.path.append(folder)
    return getattr(importlib.import_module(module), name)


def _wait_until(moment: float) -> None:
    while (left := moment - time.monotonic()) > 0:
        if left > _SPIN_S:
            time.sleep(left - _SPIN_S)


def main() -> None:
    """Read the buses from the first line, print the location of the testbed, and execute every further line."""
    testbed = UMockdev.Testbed.new()
    server = EmulationServer(testbed, json.loads(sys.stdin.readline()))
    print(json.dumps(testbed.get_root_dir()), flush=True)
    for line in sys.stdin:
        verb, *arguments = json.loads(line)
        print(json.dumps(getattr(server, verb)(*arguments)), flush=True)


if __name__ == "__main__":
    main()
