"""Emulated PCF8574 and PCF8575: latches and no registers.

Written from the data sheet and from nothing of the drivers; runs under any Python 3.11 without packages.
"""

from .i2c_device import Device


class Pcf8574(Device):
    """No registers: what is written is the latch, and a pin is high where latch and world are."""

    has_registers = False

    def __init__(self) -> None:
        super().__init__(8)

    def reset(self) -> None:
        """Do as after power-on."""
        self._latch = 0xFF

    def write(self, data: bytes) -> None:
        """Take the bytes of one message that writes."""
        if data:
            self._latch = data[-1]

    def read(self, length: int) -> bytes:
        """Return the bytes of one message that reads."""
        return bytes((self._latch & self.levels,)) * length

    def poke(self, register: int, value: int) -> None:
        """Put `value` where nobody wrote it."""
        self._latch = value


class Pcf8575(Device):
    """The same with two ports, whose bytes take turns from every START on."""

    has_registers = False

    def __init__(self) -> None:
        super().__init__(16)

    def reset(self) -> None:
        """Do as after power-on."""
        self._latches = [0xFF, 0xFF]

    def write(self, data: bytes) -> None:
        """Take the bytes of one message that writes."""
        for number, byte in enumerate(data):
            self._latches[number % 2] = byte

    def read(self, length: int) -> bytes:
        """Return the bytes of one message that reads."""
        return bytes(self._latches[number % 2] & self.port(number % 2) for number in range(length))

    def poke(self, register: int, value: int) -> None:
        """Put `value` where nobody wrote it."""
        self._latches[register & 1] = value
