"""Serves emulated I2C buses as device nodes through umockdev, controlled by JSON lines on stdin and stdout.

It is started by `umockdev-wrapper /usr/bin/python3 -I`: it needs the system's Python, which has PyGObject, and no other
package. The first line in lists buses and SPI devices; the reply is the location of the testbed. Each further line is a
list of calls, [number of the node, method, arguments...]; the reply is the list of their results.
"""

import errno
import importlib
import json
import struct
import sys
import threading
import time
from abc import ABC, abstractmethod
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import gi

gi.require_version("UMockdev", "1.0")
from gi.repository import GLib, UMockdev  # noqa: E402

from ..i2c.node import I2C_SLAVE  # noqa: E402
from ..spi.device import MODE, SPEED, TRANSFER, message  # noqa: E402
from .i2c_wire import Adapter, Message, Station, Wire  # noqa: E402

_I2C_FUNCS, _I2C_RDWR = 0x705, 0x707
# The reply to I2C_FUNCS: messages, and no SMBus transfers made of them.
_FUNCTIONS = 0x0001
_READS = 0x0001
_MESSAGE = struct.Struct("=HHHxxQ")
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
    def set_levels(self, chip: int, levels: int) -> None:
        """Set the pins of a chip, or its channels' codes."""

    @abstractmethod
    def counters(self) -> tuple[int, int, int, list[Any]]:
        """Return the numbers of calls, transfers and clock periods, and the traffic by place."""

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

    def replug(self) -> None:
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

    def __init__(
        self, testbed: Any, device: str, chips: list[dict[str, Any]], clock_hz: int, adapter: str, paced: bool
    ) -> None:
        minor = device.rpartition("-")[2]
        super().__init__(testbed, device, f"E: MAJOR=89\nE: MINOR={minor}\n", "i2c-dev")
        stations = [Station(_model(*chip.pop("kind")), **chip) for chip in chips]
        self._adapter, self._paced = Adapter(Wire(stations, clock_hz), adapter), paced

    def set_levels(self, chip: int, levels: int) -> None:
        """Set the pins of a chip, or its channels' codes."""
        self._adapter.wire.stations[chip].device.levels = levels

    def counters(self) -> tuple[int, int, int, list[Any]]:
        """Return the numbers of calls, transfers and SCL periods, and the traffic by place."""
        wire = self._adapter.wire
        return self._adapter.calls, wire.transfers, wire.scl_periods, list(wire.traffic.items())

    def fault(self, name: str, arguments: list[Any], options: dict[str, Any]) -> None:
        """Inject a fault: call this method of the adapter."""
        getattr(self._adapter, name)(*arguments, **options)

    def replace(self, chip: int, model: tuple[str, str, str]) -> None:
        """Replace a chip by a new one of another kind."""
        self._adapter.wire.stations[chip].become(_model(*model))

    def _spent_s(self) -> float:
        wire = self._adapter.wire
        return wire.duration_s(wire.scl_periods, wire.transfers) if self._paced else 0.0

    def _do(self, client: Any) -> int:
        request, arg = client.get_request(), client.get_arg()
        self._adapter.calls += 1
        if request == I2C_SLAVE:
            self._adapter.slave(struct.unpack("L", bytes(arg.retrieve()))[0] & 0x7F)
            return 0
        if request == _I2C_FUNCS:
            arg.resolve(0, 8).update(0, struct.pack("L", _FUNCTIONS))
            return 0
        if request == _I2C_RDWR:
            return self._rdwr(arg.resolve(0, 16))
        raise OSError(errno.ENOTTY, "no such request")

    def _rdwr(self, data: Any) -> int:
        _, count = struct.unpack_from("=QI", bytes(data.retrieve()))
        table = data.resolve(0, _MESSAGE.size * count)
        messages, buffers = [], []
        for number, (address, flags, length, _) in enumerate(_MESSAGE.iter_unpack(bytes(table.retrieve()))):
            buffer = table.resolve(_MESSAGE.size * number + 8, length)
            if flags & _READS:
                messages.append(Message(address, None, length))
                buffers.append((number, buffer))
            else:
                messages.append(Message(address, bytes(buffer.retrieve())))
        replies = self._adapter.rdwr(messages)
        for number, buffer in buffers:
            buffer.update(0, replies[number])
        return int(count)


class SpiNode(EmulatedNode):
    """One /dev/spidevB.C with a chip behind it, at the clock that its client requests; None: no chip."""

    def __init__(self, testbed: Any, device: str, kind: tuple[str, str, str] | None, *numbers: int) -> None:
        super().__init__(testbed, device, "E: MAJOR=153\nE: MINOR=0\n", "spidev")
        self._chip = None if kind is None else _model(*kind)(*numbers)
        self._spent, self._calls, self._transfers, self._bytes = 0.0, 0, 0, 0

    def set_levels(self, chip: int, levels: int) -> None:
        """Set the codes at the channels of its only chip."""
        if self._chip is not None:
            self._chip.levels = levels

    def counters(self) -> tuple[int, int, int, list[Any]]:
        """Return the numbers of calls, transfers and SCLK periods."""
        return self._calls, self._transfers, 8 * self._bytes, []

    def _spent_s(self) -> float:
        return self._spent

    def _do(self, client: Any) -> int:
        request, arg = client.get_request(), client.get_arg()
        if request in (MODE, SPEED):
            return 0
        size = request >> 16 & 0x3FFF
        if not size or request != message(size // TRANSFER.size):
            raise OSError(errno.ENOTTY, "no such request")
        self._calls += 1
        table = arg.resolve(0, size)
        total = 0
        for number, (_, _, length, hz, *_) in enumerate(TRANSFER.iter_unpack(bytes(table.retrieve()))):
            at = TRANSFER.size * number
            sent = bytes(table.resolve(at, length).retrieve())
            came = b"\xff" * length if self._chip is None else self._chip.transfer(sent)
            table.resolve(at + 8, length).update(0, came)
            self._transfers, self._bytes, total = self._transfers + 1, self._bytes + length, total + length
            self._spent += 8 * length / hz
        return total


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
    """Create the nodes of the first line, print the location of the testbed, and execute every further line."""
    testbed = UMockdev.Testbed.new()
    buses, devices = json.loads(sys.stdin.readline())
    nodes: list[EmulatedNode] = [I2cNode(testbed, **bus) for bus in buses]
    nodes += [SpiNode(testbed, *device) for device in devices]
    print(json.dumps(testbed.get_root_dir()), flush=True)
    for line in sys.stdin:
        with ExitStack() as locks:  # of all nodes: the calls of a line happen at one time
            for node in nodes:
                locks.enter_context(node.lock)
            results = [getattr(nodes[number], method)(*arguments) for number, method, *arguments in json.loads(line)]
        print(json.dumps(results), flush=True)


if __name__ == "__main__":
    main()
