"""What reading switches takes besides the wire: system calls on a computer, and the firmware's own work on an AVR."""

import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from fcntl import ioctl
from pathlib import Path
from statistics import median

from thenar.drivers.i2c.chips import Reading

from ...firmware.targets import TARGETS

# One transfer of a Raspberry Pi beside its wire. Doubtful: a kernel trace of a Pi 3 has 20 us from the call to the
# adapter and 6 us back; others measured 300 us (Pi Zero) with an older library.
PI_CALL_US = 30.0
MODEL_FILE = Path("/proc/device-tree/model")
_CALLS, _BATCHES = 200, 9
# Cycles of thenar's scanning firmware while no switch changes, fitted to what libsimavr counts (`avr_scans`) of 1 to
# 100 switches on chips of three kinds, within 5 %: of a scan, a key, a reading, and a byte of its answer. A change is
# debounced and told of besides: compiler.firmware.board_files has bounds.
_SCAN, _KEY, _READING, _ANSWER_BYTE = 520, 40, 530, 560
_BOARD = "avr328p"


@dataclass(frozen=True, slots=True)
class Beside:
    """Microseconds beside the wire: of a transaction and of a byte that it reads; of a scan and of a key that it reads.

    what  in a sentence, what these are and where they come from
    """

    what: str
    call_us: float = 0.0
    byte_us: float = 0.0
    scan_us: float = 0.0
    key_us: float = 0.0

    def reading_us(self, reading: Reading) -> float:
        """Return what one transaction takes beside its SCL periods."""
        return self.call_us + self.byte_us * reading.length


WIRE_ONLY = Beside("scans are those of the wire alone")


def beside_wire(target: str) -> Beside:
    """Return what reading takes on `target` (a name of `frontier --target`) beside the wire."""
    if target in TARGETS and TARGETS[target].clock_hz is not None:
        if "scan" in TARGETS[target].modes:
            return firmware_beside(target)
        return Beside(f"scans on {target} are those of the wire alone: thenar has no scanning firmware for it")
    if target == "pi" and not on_a_pi():
        return Beside(
            f"a transfer on a Raspberry Pi takes {PI_CALL_US:g} us beside the wire: doubtful, from a kernel trace of a "
            "Pi 3; run thenar frontier on the Pi itself",
            call_us=PI_CALL_US,
        )
    measured = measured_call_us()
    return Beside(
        f"a transfer takes {measured:.1f} us beside the wire, measured here: the system call, without what the "
        "adapter's driver adds",
        call_us=measured,
    )


def firmware_beside(target: str) -> Beside:
    """Return what thenar's scanning firmware takes on an AVR at its usual clock, while no switch changes."""
    part = TARGETS[target]
    assert part.clock_hz is not None
    us = 1e6 / part.clock_hz
    return Beside(
        f"scans on {part.named} hold the cycles that thenar's firmware takes beside the wire while no switch changes",
        call_us=_READING * us,
        byte_us=_ANSWER_BYTE * us,
        scan_us=_SCAN * us,
        key_us=_KEY * us,
    )


def board_beside() -> Beside:
    """Return what a scanner board of thenar's firmware takes before it sends."""
    return firmware_beside(_BOARD)


def on_a_pi() -> bool:
    """Return whether this machine is a Raspberry Pi."""
    try:
        return "Raspberry Pi" in MODEL_FILE.read_text(errors="replace")
    except OSError:
        return False


def measured_call_us() -> float:
    """Return what a transfer takes here, as drivers.i2c.node makes it, on a device that refuses it at once.

    The median of several means: a moment in which other work ran does not count.
    """
    from smbus2 import i2c_msg
    from smbus2.smbus2 import I2C_RDWR, i2c_rdwr_ioctl_data

    answer = i2c_msg.read(0x20, 2)
    messages = [i2c_msg.write(0x20, b"\x12"), answer]
    transfer = i2c_rdwr_ioctl_data.create(*messages)  # type: ignore[arg-type]  # as in node.py
    device = os.open(os.devnull, os.O_RDWR)
    try:
        return median(
            _mean_us(lambda: ioctl(device, I2C_RDWR, transfer), lambda: bytes(answer)) for _ in range(_BATCHES)
        )
    finally:
        os.close(device)


def _mean_us(call: Callable[[], object], answered: Callable[[], object]) -> float:
    start = time.perf_counter()
    for _ in range(_CALLS):
        with suppress(OSError):
            call()
        answered()
    return 1e6 * (time.perf_counter() - start) / _CALLS
