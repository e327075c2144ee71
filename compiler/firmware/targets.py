"""What firmware is made for: this machine, and microcontrollers with their memories."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from .errors import FirmwareError

__all__ = ["TARGETS", "Kind", "Target", "target_of"]

Kind = Literal["host", "avr", "cortex-m"]


@dataclass(frozen=True, slots=True)
class Target:
    """A part, as avr-gcc and arm-none-eabi-gcc call it: flash and RAM in bytes, and its usual clock if it has one."""

    kind: Kind
    part: str
    flash: int
    ram: int
    clock_hz: int | None = None

    @property
    def counted(self) -> bool:
        """Whether costs are bounds, counted instruction by instruction; elsewhere they are estimates."""
        return self.kind == "avr"

    @property
    def named(self) -> str:
        """The part with its article: "an atmega328p"."""
        return f"{'an' if self.part.startswith('a') else 'a'} {self.part}"


# ATmega328P: DS40002061, section 8; ATmega2560: DS40002211, section 8; both as Arduino boards clock them. A core of Arm
# comes with any memory: these are small ones, and fit the machines of qemu on which such firmware is tested.
_ALL = (
    Target("host", "host", 1 << 30, 1 << 30),
    Target("avr", "atmega328p", 32 << 10, 2 << 10, 16_000_000),
    Target("avr", "atmega2560", 256 << 10, 8 << 10, 16_000_000),
    Target("cortex-m", "cortex-m0plus", 128 << 10, 16 << 10),
    Target("cortex-m", "cortex-m4", 256 << 10, 64 << 10),
)
TARGETS: Mapping[str, Target] = MappingProxyType({target.part: target for target in _ALL})


def target_of(part: str) -> Target:
    """Return the target of that part. Raises FirmwareError if there is none."""
    if part not in TARGETS:
        raise FirmwareError(f"there is no target {part!r}: choose one of {', '.join(TARGETS)}")
    return TARGETS[part]
