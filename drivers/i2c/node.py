"""A device node /dev/i2c-N: transfers in the form of the kernel, and the meaning of their errno."""

import errno
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from fcntl import ioctl
from typing import TYPE_CHECKING

from ..errors import DeviceError
from ..ports import cause, check_device, check_node

if TYPE_CHECKING:
    from smbus2 import SMBus

# No acknowledge: bcm2835 and designware, i2c-gpio, i2c-stub.
NOBODY_THERE = frozenset({errno.EREMOTEIO, errno.ENXIO, errno.ENODEV})
# A line may be held low.
STUCK = frozenset({errno.ETIMEDOUT, errno.EBUSY, errno.EAGAIN})
# The adapter's driver rejects the batch, not the chip.
REFUSED = frozenset({errno.EOPNOTSUPP, errno.EINVAL})

_MEANINGS = {
    errno.ETIMEDOUT: "the transfer did not end: SCL or SDA is held low, or the chip stretches the clock",
    errno.EAGAIN: "the adapter lost arbitration: is SDA held low, or is there another master?",
    errno.EIO: "the transfer broke off: check cable length, pull-ups and supply",
    errno.EBUSY: "busy: a kernel driver has the address (unbind it), or SDA is held low",
    errno.EOPNOTSUPP: "this adapter cannot do such a transfer: use another adapter",
}
_MISSING = "there is no such bus; is the adapter plugged in, is I2C switched on, is the module i2c-dev loaded?"


def failure(named: str, code: int | None) -> str:
    """Return a message about a failed transfer with the chip `named`."""
    words = f"does not work: {_MEANINGS.get(code or errno.EIO, 'the transfer failed: check cable and adapter')}"
    if code in NOBODY_THERE:
        words = "does not reply: check its supply, its wires and its address pins"
    return f"{named} {words} (errno {code})"


def stuck(device: str, code: int | None) -> str:
    """Return a message about a stuck bus."""
    found = "SDA reads low all the time" if code is None else f"every transfer fails (errno {code})"
    return (
        f"{device} is stuck: {found}. It is retried once a second; if that does not help, look for a wire to ground, "
        "power-cycle the chips, or clock SCL nine times by hand (unbind the adapter's driver first)"
    )


MOST_MESSAGES = 42
I2C_SLAVE = 0x0703

# The specification reserves 1111 1XX: no chip acknowledges this address.
NOBODY = 0x7F

Run = Callable[[], list[bytes]]


class BatchMode(Enum):
    """Batching of reads, from the fastest to the one that always works.

    i2c-gpio accepts any batch; designware (Raspberry Pi 5, many PCs) one address a transfer, else EINVAL; bcm2835
    (Raspberry Pi 0 to 4) one read a transfer, else EOPNOTSUPP.
    """

    CHANNEL = "all ports between two mux switches in one transfer"
    CHIP = "all ports of a chip in one transfer"
    PORT = "one transfer per port"

    def lower(self) -> "BatchMode":
        """Return the next less demanding way; for the last, itself."""
        ways = list(BatchMode)
        return ways[min(ways.index(self) + 1, len(ways) - 1)]


@dataclass(frozen=True, slots=True)
class Query:
    """An optional command to write, and the number of bytes to read then, without a STOP in between."""

    address: int
    command: bytes
    length: int

    @property
    def messages(self) -> int:
        """Number of I2C messages."""
        return 2 if self.command else 1


class DeviceNode:
    """The open node. Errors of transfers are OSErrors of the adapter; `transfers` counts the ioctl calls.

    way is the batching that its adapter supports, as far as it is known.
    Use it from one thread at a time: the buffers of prepared transfers are reused.
    """

    def __init__(self, device: str) -> None:
        """Raise SettingError if `device` is not the path of a device."""
        check_device(device)
        self.device = device
        self.transfers = 0
        self.way = BatchMode.CHANNEL
        self._bus: SMBus | None = None

    @property
    def is_open(self) -> bool:
        """Whether transfers are possible."""
        return self._bus is not None and self._bus.fd is not None

    def open(self) -> None:
        """Open or reopen the node; prepared transfers stay valid. Raises DeviceError with a remedy."""
        from smbus2 import SMBus

        self.close()
        check_node(self.device)
        bus = self._bus = self._bus or SMBus()
        try:
            bus.open(self.device)
        except OSError as error:
            bus.close()
            raise DeviceError(f"{self.device} cannot be opened: {cause(error, 'I2C', _MISSING)}") from None

    def close(self) -> None:
        """Close the node; no transfers are possible until it is reopened."""
        if self._bus is not None:
            self._bus.close()

    def claim(self, address: int) -> None:
        """Select an address. Raises OSError EBUSY if a kernel driver has it."""
        bus = self._ready()
        assert bus.fd is not None
        ioctl(bus.fd, I2C_SLAVE, address)
        bus.address = None  # smbus2 caches the last address

    def write(self, address: int, data: bytes) -> None:
        """Write bytes in one transfer."""
        from smbus2 import i2c_msg

        bus = self._ready()
        self.transfers += 1
        bus.i2c_rdwr(i2c_msg.write(address, data))

    def query(self, query: Query) -> bytes:
        """Write and read in one transfer."""
        return self.prepare((query,))()[0]

    def prepare(self, queries: Sequence[Query]) -> Run:
        """Return a function that makes all queries in one transfer and returns the replies."""
        from smbus2 import i2c_msg
        from smbus2.smbus2 import I2C_RDWR, i2c_rdwr_ioctl_data

        bus = self._ready()
        replies = [i2c_msg.read(query.address, query.length) for query in queries]
        messages: list[i2c_msg] = []
        for query, reply in zip(queries, replies, strict=True):
            messages += [i2c_msg.write(query.address, query.command), reply] if query.command else [reply]
        # i2c_rdwr of smbus2 would create this at every call.
        transfer = i2c_rdwr_ioctl_data.create(*messages)  # type: ignore[arg-type]  # smbus2 is typed for a list, but takes arguments

        def run() -> list[bytes]:
            self.transfers += 1
            assert bus.fd is not None
            ioctl(bus.fd, I2C_RDWR, transfer)
            return [bytes(reply) for reply in replies]

        return run

    def _ready(self) -> "SMBus":
        if self._bus is None or not self.is_open:
            raise OSError(errno.EBADF, f"{self.device} is not open")
        return self._bus
