"""What the kernel's adapter drivers let through to the wire, and which errno they answer with.

Read from the kernel's sources: i2c-bcm2835 (Raspberry Pi 0 to 4), i2c-designware-master (Raspberry Pi 5, many PCs),
i2c-algo-bit (i2c-gpio); "any" has no limits of its own, "smbus-only" offers no I2C_RDWR at all, as many PC chipsets.
"""

import errno
from dataclasses import dataclass

from .i2c_wire import Message, NakError, Wire

MOST_MESSAGES = 42
FUNC_I2C = 0x00000001
FUNC_SMBUS = 0x0EFF0008

QUICK, BYTE, BYTE_DATA, WORD_DATA, I2C_BLOCK = 0, 1, 2, 3, 8
_READ_SIZES = {BYTE: 1, BYTE_DATA: 1, WORD_DATA: 2}


@dataclass(frozen=True)
class Temper:
    """How an adapter is: errno of a NAK; errno with SDA held low (None: it notices nothing)."""

    nak: int
    stuck: int | None
    plain_i2c: bool = True


ADAPTERS = {
    "bcm2835": Temper(errno.EREMOTEIO, errno.ETIMEDOUT),
    "designware": Temper(errno.EREMOTEIO, errno.EAGAIN),
    "i2c-gpio": Temper(errno.ENXIO, None),
    "any": Temper(errno.EREMOTEIO, errno.EBUSY),
    "smbus-only": Temper(errno.ENXIO, errno.EBUSY, plain_i2c=False),
}


@dataclass
class TransferFault:
    """Transfers that go wrong with errno `code`: those to `address` (None: all), so many `times` (None: until healed).

    `batches` alone: only transfers of more than one write and read.
    """

    code: int
    address: int | None = None
    times: int | None = None
    batches: bool = False

    def hits(self, messages: list[Message]) -> bool:
        """Tell whether these messages go wrong, and count it."""
        met = self.address is None or any(message.address == self.address for message in messages)
        if not met or self.times == 0 or (self.batches and len(messages) <= 2):
            return False
        if self.times is not None:
            self.times -= 1
        return True


class Adapter:
    """One bus as the kernel shows it: every refusal is an OSError with the errno of this adapter."""

    def __init__(self, wire: Wire, kind: str) -> None:
        self.wire = wire
        self.kind = kind
        self.temper = ADAPTERS[kind]
        self.faults: list[TransferFault] = []
        self.claimed: set[int] = set()
        self.stuck_for: int | None = None
        self.calls = 0

    @property
    def funcs(self) -> int:
        """The answer to I2C_FUNCS."""
        return FUNC_SMBUS | (FUNC_I2C if self.temper.plain_i2c else 0)

    def slave(self, address: int) -> None:
        """I2C_SLAVE: EBUSY where a driver of the kernel holds the address."""
        if address in self.claimed:
            raise OSError(errno.EBUSY, "claimed")

    def stick(self, transfers: int | None) -> None:
        """Hold SDA low: until healed, or until so many transfers have clocked it free."""
        self.stuck_for, self.wire.sda_low = transfers, True

    def heal(self) -> None:
        """End every fault of the wire."""
        self.faults.clear()
        self.claimed.clear()
        self.stuck_for, self.wire.sda_low = None, False
        self.wire.absent_muxes.clear()
        for station in self.wire.stations:
            station.absent = False

    def rdwr(self, messages: list[Message]) -> list[bytes]:
        """I2C_RDWR: send all messages in one transfer."""
        if not self.temper.plain_i2c:
            raise OSError(errno.EOPNOTSUPP, "no I2C_RDWR")
        if len(messages) > MOST_MESSAGES:
            raise OSError(errno.EINVAL, "too many messages")
        if self.kind == "bcm2835" and any(message.data is None for message in messages[:-1]):
            raise OSError(errno.EOPNOTSUPP, "one read, and it must be the last")
        if self.kind == "designware" and len({message.address for message in messages}) > 1:
            raise OSError(errno.EINVAL, "one address a transfer")
        return self._transfer(messages)

    def smbus(self, address: int, reads: bool, command: int, size: int, block: bytes) -> bytes:
        """I2C_SMBUS as the kernel makes it of messages: `block` is what to write, or as long as what to read."""
        if size == QUICK:
            return self._transfer([Message(address, None if reads else b"")])[0]
        if size not in (*_READ_SIZES, I2C_BLOCK):
            raise OSError(errno.EOPNOTSUPP, "no such SMBus transfer")
        if not reads:
            return self._transfer([Message(address, bytes((command,)) + (b"" if size == BYTE else block))])[0]
        read = Message(address, None, _READ_SIZES.get(size, len(block)))
        return self._transfer([read] if size == BYTE else [Message(address, bytes((command,))), read])[-1]

    def _transfer(self, messages: list[Message]) -> list[bytes]:
        for fault in self.faults:
            if fault.hits(messages):
                raise OSError(fault.code, "injected")
        if self.wire.sda_low:
            self._clock_out()
        try:
            return self.wire.transfer(messages)
        except NakError:
            raise OSError(self.temper.nak, "NAK") from None

    def _clock_out(self) -> None:
        if self.stuck_for is not None:
            self.stuck_for -= 1
            self.wire.sda_low = self.stuck_for > 0
        if self.wire.sda_low and self.temper.stuck is not None:
            raise OSError(self.temper.stuck, "SDA is low")
