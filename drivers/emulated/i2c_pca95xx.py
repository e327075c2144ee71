"""Emulated PCA9555, TCA9555 and TCA6424A: registers in groups, one a port.

Written from the data sheet and from nothing of the drivers; runs under any Python 3.11 without packages.
"""

from abc import abstractmethod

from .i2c_device import Device


class _Banked(Device):
    """Banks of inputs, outputs, polarities and configurations, `stride` registers apart; pins as the world has them."""

    _ports: int
    _stride: int

    def __init__(self) -> None:
        super().__init__(8 * self._ports)

    def reset(self) -> None:
        """Do as after power-on."""
        self._outputs = [0xFF] * self._ports
        self._polarities = [0x00] * self._ports
        self._inputs = [0xFF] * self._ports
        self._pointer = 0
        self._moves = True

    def read(self, length: int) -> bytes:
        """Return the bytes of one message that reads."""
        answer = bytearray()
        for _ in range(length):
            answer.append(self._load())
            self._advance()
        return bytes(answer)

    def write(self, data: bytes) -> None:
        """Take the bytes of one message that writes."""
        if data:
            self._command(data[0])
        for byte in data[1:]:
            bank, port = divmod(self._pointer, self._stride)
            if bank and port < self._ports:
                (self._outputs, self._polarities, self._inputs)[bank - 1][port] = byte
            self._advance()

    @abstractmethod
    def _command(self, byte: int) -> None:
        """Take the byte of a message that says where to write, or to read from."""

    def _advance(self) -> None:
        if self._moves:
            bank, port = divmod(self._pointer, self._stride)
            self._pointer = bank * self._stride + (port + 1) % self._ports

    def _load(self) -> int:
        bank, port = divmod(self._pointer, self._stride)
        if port >= self._ports:
            return 0
        if bank:
            return (self._outputs, self._polarities, self._inputs)[bank - 1][port]
        inputs = self._inputs[port]
        return (self.port(port) & inputs | self._outputs[port] & ~inputs & 0xFF) ^ self._polarities[port]


class Pca9555(_Banked):
    """Pairs of registers 0 to 7; the byte after a register's is the other's of its pair."""

    _ports, _stride = 2, 2

    def _command(self, byte: int) -> None:
        self._pointer = byte & 7


class Tca6424a(_Banked):
    """Groups of three registers, four apart; bit 7 of the command lets the pointer go round its group."""

    _ports, _stride = 3, 4

    def _command(self, byte: int) -> None:
        self._pointer, self._moves = byte & 0xF, bool(byte & 0x80)
