"""A device node /dev/i2c-N: transfers as the kernel takes them, and what the errno of one that failed means."""

import errno
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from fcntl import ioctl
from typing import TYPE_CHECKING

from ..errors import DeviceError, SettingError
from ..names import shortened
from ..ports import check_node, device_fault

if TYPE_CHECKING:
    from smbus2 import SMBus

# No acknowledge: bcm2835 and designware, i2c-gpio, i2c-stub.
NOBODY_THERE = frozenset({errno.EREMOTEIO, errno.ENXIO, errno.ENODEV})
# A line may be held low.
STUCK = frozenset({errno.ETIMEDOUT, errno.EBUSY, errno.EAGAIN})
# The adapter's driver refuses the batch, not the chip.
REFUSED = frozenset({errno.EOPNOTSUPP, errno.EINVAL})

_MEANINGS = {
    errno.ETIMEDOUT: "the transfer did not end: SCL or SDA is held low, or the chip stretches the clock",
    errno.EAGAIN: "the adapter lost SDA to somebody else: is the line held low, or is there another master?",
    errno.EIO: "the transfer broke off: check cable length, pull-ups and supply",
    errno.EBUSY: "busy: a driver of the kernel has the address (unbind it), or SDA is held low",
    errno.EOPNOTSUPP: "this adapter cannot do such a transfer: use another adapter",
}


def failure(named: str, code: int | None) -> str:
    """Return what to say of a transfer with what is `named`."""
    words = f"does not work: {_MEANINGS.get(code or errno.EIO, 'the transfer failed: check cable and adapter')}"
    if code in NOBODY_THERE:
        words = "does not answer: check its supply, its wires and its address pins"
    return f"{named} {words} (errno {code})"


def stuck(device: str, code: int | None) -> str:
    """Return what to say of a bus on which nothing goes any more."""
    found = "SDA reads low all the time" if code is None else f"every transfer fails (errno {code})"
    return (
        f"{device} is stuck: {found}. Tries go on once a second; if they do not help, look for a wire to ground, take "
        "the chips' supply away for a moment, or clock SCL nine times by hand (unbind the adapter's driver first)"
    )


MOST_MESSAGES = 42
_FUNC_I2C = 0x00000001
_I2C_SLAVE = 0x0703

# The specification keeps 1111 1XX for other uses: no chip acknowledges this address.
NOBODY = 0x7F

Run = Callable[[], list[bytes]]


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


@dataclass(frozen=True, slots=True)
class Query:
    """A command to write, where there is one, and how many bytes to read then, without a STOP in between."""

    address: int
    command: bytes
    length: int

    @property
    def messages(self) -> int:
        """How many I2C messages this takes."""
        return 2 if self.command else 1


class Node:
    """The open node. Errors of transfers are OSErrors as the adapter gives them; `transfers` counts the ioctl calls.

    way is how its adapter takes them, as far as that is known.
    One thread at a time: the buffers of prepared transfers are used again and again.
    """

    def __init__(self, device: str) -> None:
        """Raise SettingError if `device` is no path of a device."""
        if fault := device_fault(device):
            raise SettingError(f"{shortened(repr(device))} {fault}")
        self.device = device
        self.transfers = 0
        self.way = Way.CHANNEL
        self._bus: SMBus | None = None

    @property
    def is_open(self) -> bool:
        """Whether transfers are possible."""
        return self._bus is not None and self._bus.fd is not None

    def open(self) -> None:
        """Open the node, anew if it was open: what was prepared stays good. Raises DeviceError with what to check."""
        from smbus2 import SMBus

        self.close()
        check_node(self.device)
        bus = self._bus = self._bus or SMBus()
        try:
            bus.open(self.device)
        except OSError as error:
            bus.close()
            raise DeviceError(f"{self.device} cannot be opened: {_cause(error)}") from None

    def find_way(self) -> None:
        """Begin with the best way that the open adapter may have."""
        self.way = Way.CHANNEL if self._bus is not None and self._bus.funcs & _FUNC_I2C else Way.SMBUS

    def close(self) -> None:
        """Close the node; there are no transfers until it is opened again."""
        if self._bus is not None:
            self._bus.close()

    def claim(self, address: int) -> None:
        """Ask for an address. Raises OSError EBUSY where a driver of the kernel has it."""
        bus = self._ready()
        assert bus.fd is not None
        ioctl(bus.fd, _I2C_SLAVE, address)
        bus.address = None  # smbus2 remembers whom it asked for last

    def write(self, address: int, data: bytes) -> None:
        """Write bytes in one transfer."""
        bus = self._ready()
        self.transfers += 1
        if self.way is not Way.SMBUS:
            from smbus2 import i2c_msg

            bus.i2c_rdwr(i2c_msg.write(address, data))
        elif len(data) == 1:
            bus.write_byte(address, data[0])
        else:
            bus.write_i2c_block_data(address, data[0], list(data[1:]))

    def query(self, query: Query) -> bytes:
        """Write and read in one transfer."""
        return self.prepare((query,))()[0]

    def prepare(self, queries: Sequence[Query]) -> Run:
        """Return what does all queries in one transfer and returns their answers; SMBus takes one query alone."""
        bus = self._ready()
        if self.way is Way.SMBUS:
            (query,) = queries
            return lambda: [self._by_smbus(bus, query)]
        from smbus2 import i2c_msg
        from smbus2.smbus2 import I2C_RDWR, i2c_rdwr_ioctl_data

        answers = [i2c_msg.read(query.address, query.length) for query in queries]
        messages: list[i2c_msg] = []
        for query, answer in zip(queries, answers, strict=True):
            messages += [i2c_msg.write(query.address, query.command), answer] if query.command else [answer]
        # What i2c_rdwr of smbus2 makes anew at every call.
        transfer = i2c_rdwr_ioctl_data.create(*messages)  # type: ignore[arg-type]  # smbus2 says a list, and takes them apart

        def run() -> list[bytes]:
            self.transfers += 1
            assert bus.fd is not None
            ioctl(bus.fd, I2C_RDWR, transfer)
            return [bytes(answer) for answer in answers]

        return run

    def _ready(self) -> "SMBus":
        if self._bus is None or not self.is_open:
            raise OSError(errno.EBADF, f"{self.device} is not open")
        return self._bus

    def _by_smbus(self, bus: "SMBus", query: Query) -> bytes:
        self.transfers += 1
        if not query.command:
            if query.length == 1:
                return bytes((bus.read_byte(query.address),))
            raise OSError(errno.EOPNOTSUPP, "SMBus reads one byte at most without a command")
        command = query.command[0]
        if query.length == 1:
            return bytes((bus.read_byte_data(query.address, command),))
        if query.length == 2:
            return bus.read_word_data(query.address, command).to_bytes(2, "little")
        return bytes(bus.read_i2c_block_data(query.address, command, query.length))


def _cause(error: OSError) -> str:
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return "there is no such bus; is the adapter plugged in, is I2C switched on, is the module i2c-dev loaded?"
    if error.errno in (errno.EACCES, errno.EPERM):
        return "you may not; is your user in the group i2c?"
    return f"{os.strerror(error.errno or errno.EIO)}; is it an I2C device?"
