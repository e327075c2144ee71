"""The machines of qemu on which code for a Cortex-M runs.

qemu 7 has no Cortex-M0+, but a Cortex-M0, on the micro:bit, whose instructions are the same (ARMv6-M): it refuses those
of a larger core. Code for a Cortex-M4 runs on one, of Arm's MPS2 board with image AN386. Both have flash at 0 and
RAM at 0x20000000.
"""

from dataclasses import dataclass

from .errors import FirmwareError
from .targets import Target


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine of qemu: its memory in bytes and SysTick's clock."""

    name: str
    flash: int
    ram: int
    systick_hz: int


_MACHINES = {
    "cortex-m0plus": Machine("microbit", 256 << 10, 16 << 10, 16_000_000),
    "cortex-m4": Machine("mps2-an386", 4 << 20, 4 << 20, 25_000_000),
}


def machine_of(target: Target) -> Machine:
    """Return the machine that runs code for `target`. Raises FirmwareError if there is none."""
    if target.part not in _MACHINES:
        raise FirmwareError(f"no machine of qemu for {target.part!r}: there are ones for {' and '.join(_MACHINES)}")
    return _MACHINES[target.part]
