"""The microcontrollers that board firmware is written for: their pins, and what else some of them can be."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Part:
    """A microcontroller.

    pins      usable as inputs and outputs, as the data sheet calls them; without crystal and reset
    uarts     the (RXD, TXD) pins of every UART
    twi       the SDA and SCL pins
    analog    the channels of its converter by name, with the pin each shares; "" for a channel without a digital pin
    jtag      pins that the JTAG interface holds until it is switched off
    avrdude   what avrdude calls it, and `programmer` the boot loader of the usual boards with it
    brown_out what its fuses should say of brown-out at its highest clock
    """

    name: str
    pins: tuple[str, ...]
    uarts: tuple[tuple[str, str], ...]
    twi: tuple[str, str]
    analog: Mapping[str, str]
    jtag: tuple[str, ...]
    highest_hz: int
    avrdude: str
    programmer: str
    brown_out: str


def _pins(**ports: int) -> tuple[str, ...]:
    return tuple(f"P{port}{bit}" for port, count in ports.items() for bit in range(count))


def _channels(*ports: str) -> dict[str, str]:
    return {f"ADC{8 * place + bit}": f"P{port}{bit}" for place, port in enumerate(ports) for bit in range(8)}


# ATmega48A/PA/88A/PA/168A/PA/328/P, DS40002061: PB6 and PB7 carry the crystal, PC6 is RESET; ADC6 and ADC7 are pins of
# their own, which only the packages with 32 leads have.
_ATMEGA328P = Part(
    name="atmega328p",
    pins=_pins(B=6, C=6, D=8),
    uarts=(("PD0", "PD1"),),
    twi=("PC4", "PC5"),
    analog=_channels("C") | {"ADC6": "", "ADC7": ""},
    jtag=(),
    highest_hz=20_000_000,
    avrdude="m328p",
    programmer="arduino",
    brown_out="4.3 V, extended fuse 0xFC; at 8 MHz or less 2.7 V, 0xFD",
)

# ATmega640/1280/1281/2560/2561, DS40002211: crystal and RESET have pins of their own.
_ATMEGA2560 = Part(
    name="atmega2560",
    pins=_pins(A=8, B=8, C=8, D=8, E=8, F=8, G=6, H=8, J=8, K=8, L=8),
    uarts=(("PE0", "PE1"), ("PD2", "PD3"), ("PH0", "PH1"), ("PJ0", "PJ1")),
    twi=("PD1", "PD0"),
    analog=_channels("F", "K"),
    jtag=("PF4", "PF5", "PF6", "PF7"),
    highest_hz=16_000_000,
    avrdude="m2560",
    programmer="wiring",
    brown_out="4.3 V, extended fuse 0xFC; at 8 MHz or less 2.7 V, 0xFD",
)

PARTS: Mapping[str, Part] = MappingProxyType({part.name: part for part in (_ATMEGA328P, _ATMEGA2560)})
