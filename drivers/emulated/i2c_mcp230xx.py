"""Emulated MCP23008 and MCP23017.

Written from the data sheet and from nothing of the drivers; runs under any Python 3.11 without packages.
"""

from .i2c_device import Device


class _Mcp230xx(Device):
    """Registers with a pointer that goes on by itself; pins without pull-up float, and then read 0 here."""

    _INPUTS, _POLARITY, _CONTROL, _PULL_UPS, _FLAGS, _CAPTURE, _PINS, _LATCH = 0, 1, 5, 6, 7, 8, 9, 10
    _REGISTERS = 11

    def __init__(self, ports: int) -> None:
        self._ports = ports
        super().__init__(8 * ports)

    def reset(self) -> None:
        """Do as after power-on."""
        self._values = [[0] * self._REGISTERS for _ in range(self._ports)]
        for values in self._values:
            values[self._INPUTS] = 0xFF
        self._pointer = 0

    def write(self, data: bytes) -> None:
        """Take the bytes of one message that writes."""
        if data:
            self._pointer = data[0] & 0x1F
        for byte in data[1:]:
            self._store(*self._decode(self._pointer), byte)
            self._advance()

    def read(self, length: int) -> bytes:
        """Return the bytes of one message that reads."""
        answer = bytearray()
        for _ in range(length):
            answer.append(self._load(*self._decode(self._pointer)))
            self._advance()
        return bytes(answer)

    def _decode(self, address: int) -> tuple[int, int]:
        """Return port and register; a register that is none, where there is nothing."""
        return 0, address

    def _advance(self) -> None:
        if not self._values[0][self._CONTROL] & 0x20:
            self._pointer = (self._pointer + 1) % self._REGISTERS

    def _store(self, port: int, register: int, byte: int) -> None:
        if register == self._CONTROL:
            for values in self._values:
                values[register] = byte
        elif register == self._PINS:
            self._values[port][self._LATCH] = byte
        elif register < self._REGISTERS and register not in (self._FLAGS, self._CAPTURE):
            self._values[port][register] = byte

    def _load(self, port: int, register: int) -> int:
        if register >= self._REGISTERS:
            return 0
        values = self._values[port]
        if register != self._PINS:
            return values[register]
        inputs = values[self._INPUTS]
        seen = self.port(port) & values[self._PULL_UPS] ^ values[self._POLARITY]
        return seen & inputs | values[self._LATCH] & ~inputs


class Mcp23008(_Mcp230xx):
    """One port, registers 00 to 0A."""

    def __init__(self) -> None:
        super().__init__(ports=1)


class Mcp23017(_Mcp230xx):
    """Two ports; BANK (bit 7 of IOCON) says whether their registers alternate or follow each other."""

    def __init__(self) -> None:
        super().__init__(ports=2)

    def _bank(self) -> int:
        return self._values[0][self._CONTROL] >> 7

    def _decode(self, address: int) -> tuple[int, int]:
        return (address >> 4, address & 0xF) if self._bank() else (address & 1, address >> 1)

    def _advance(self) -> None:
        still = self._values[0][self._CONTROL] & 0x20
        if self._bank():
            self._pointer = self._pointer if still else (self._pointer + 1) % 0x1B
        else:
            self._pointer = self._pointer ^ 1 if still else (self._pointer + 1) % 0x16
