"""What has an address on an emulated I2C bus.

Written from the data sheet and from nothing of the drivers; runs under any Python 3.11 without packages.
"""

from abc import ABC, abstractmethod


class Device(ABC):
    """Something with an address. `levels` are its pins as the world drives them: bit p is pin p, 1 is high or open."""

    has_registers = True

    def __init__(self, pins: int) -> None:
        self.pins = pins
        self.levels = (1 << pins) - 1
        self.reset()

    @abstractmethod
    def reset(self) -> None:
        """Do as after power-on."""

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Take the bytes of one message that writes."""

    @abstractmethod
    def read(self, length: int) -> bytes:
        """Return the bytes of one message that reads."""

    def poke(self, register: int, value: int) -> None:
        """Put `value` where nobody wrote it, as a crash of the last owner may have left it."""
        self.write(bytes((register, value)))

    def port(self, number: int) -> int:
        """Return the levels of eight pins."""
        return self.levels >> 8 * number & 0xFF
