"""Emulated TCA9548A.

Written from the data sheet and from nothing of the drivers; runs under any Python 3.11 without packages.
"""

from .i2c_device import Device


class Tca9548a(Device):
    """The mux: its control byte takes effect at the STOP."""

    has_registers = False

    def __init__(self) -> None:
        super().__init__(0)

    def reset(self) -> None:
        """Do as after power-on."""
        self.control = self.connected = 0

    def write(self, data: bytes) -> None:
        """Take the bytes of one message that writes."""
        if data:
            self.control = data[-1]

    def read(self, length: int) -> bytes:
        """Return the bytes of one message that reads."""
        return bytes((self.control,)) * length

    def stop(self) -> None:
        """See a STOP go by."""
        self.connected = self.control

    def poke(self, register: int, value: int) -> None:
        """Put `value` where nobody wrote it."""
        self.control = self.connected = value
