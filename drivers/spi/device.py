"""A converter at a device node /dev/spidevB.C: all its channels in one kernel call."""

import ctypes
import os
import struct
from collections.abc import Callable, Sequence
from fcntl import ioctl

from ..closing import Closing
from ..errors import DeviceError
from ..i2c.chips import Reading
from ..ports import cause, check_device, check_node
from .chips import SpiChip

# The kernel's linux/spi/spidev.h: struct spi_ioc_transfer, and _IOW('k', number, size of the argument).
TRANSFER = struct.Struct("=QQIIHBBBBBB")
MODE, SPEED = 0x40016B01, 0x40046B04
_BITS = 8
_MESSAGE, _SIZE_BITS = 0x40006B00, 16
_MISSING = "there is no such device; is SPI switched on, is the module spidev loaded?"


def message(transfers: int) -> int:
    """Return the ioctl request for this number of transfers."""
    return _MESSAGE | transfers * TRANSFER.size << _SIZE_BITS


class SpiDevice(Closing):
    """The converter at one device node. Use it from one thread at a time.

    calls   number of kernel calls
    silent  number of replies that did not come from a converter
    """

    def __init__(self, device: str, chip: SpiChip, clock_hz: int) -> None:
        """Raise SettingError if `device` is not the path of a device."""
        check_device(device)
        self.device, self.chip, self.clock_hz = device, chip, clock_hz
        self.calls = self.silent = 0
        self._file: int | None = None

    def open(self) -> None:
        """Open the node. Raises DeviceError with a remedy."""
        self.close()
        check_node(self.device)
        try:
            self._file = os.open(self.device, os.O_RDWR | os.O_CLOEXEC)
            ioctl(self._file, MODE, b"\0")
            ioctl(self._file, SPEED, struct.pack("=I", self.clock_hz))
        except OSError as error:
            self.close()
            raise DeviceError(f"{self.device} cannot be opened: {cause(error, 'SPI', _MISSING)}") from None

    def prepare(self, transfers: Sequence[Reading]) -> Callable[[], list[int | None]]:
        """Return a function that makes these transfers in one call, with chip select high in between.

        It returns the code of each, None for a reply that did not come from a converter, and raises DeviceError if the
        device is gone.
        """
        sent = [ctypes.create_string_buffer(each.command, len(each.command)) for each in transfers]
        came = [ctypes.create_string_buffer(len(each.command)) for each in transfers]
        between = [1] * (len(transfers) - 1) + [0]
        # The kernel writes to the addresses in the table; the buffers live as long as the returned function.
        table = b"".join(
            TRANSFER.pack(
                ctypes.addressof(out), ctypes.addressof(in_), len(out), self.clock_hz, 0, _BITS, high, *[0] * 4
            )
            for out, in_, high in zip(sent, came, between, strict=True)
        )
        request, buffers = message(len(transfers)), (sent, came)

        def run() -> list[int | None]:
            if self._file is None:
                raise DeviceError(f"{self.device} is not open: open it first")
            self.calls += 1
            try:
                ioctl(self._file, request, table)
            except OSError as error:
                raise DeviceError(f"{self.device} does not work: {cause(error, 'SPI', _MISSING)}") from None
            codes = [self.chip.code(reply.raw) for reply in buffers[1]]
            self.silent += codes.count(None)
            return codes

        return run

    def close(self) -> None:
        """Close the node."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
