"""The chips as parts to buy and to solder: part number, package, and which of its pins is which.

Pins are those of the data sheets' packages (Microchip DS20001952 and DS20001919, NXP PCF8574 and PCA9555, TI PCF8575,
TCA9555, TCA6424A and TCA9548A); an expander's inputs are called as its driver calls them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.registry import CHIPS

SUPPLY = ("VDD", "VCC", "VCCI", "VCCP")
GROUND = ("VSS", "GND", "EP")
RESET = "RESET"
_SELECTS = ("A0", "A1", "A2", "ADDR")


@dataclass(frozen=True, slots=True)
class Package:
    """A chip in one package. pins[n - 1] is the name of pin n, "NC" where there is nothing inside.

    pulls_up   whether its inputs are pulled up inside, by the chip itself or once it is set up
    sure       whether part number, pins and footprint are each confirmed by two sources; `note` says what is not
    """

    part: str
    maker: str
    symbol: str
    footprint: str
    pins: tuple[str, ...]
    lowest_address: int
    pulls_up: bool = True
    sure: bool = True
    note: str = ""

    def number(self, name: str) -> str:
        """Return the number of the pin called `name`."""
        return str(self.pins.index(name) + 1)

    def selects(self, address: int) -> tuple[tuple[str, bool], ...]:
        """Return the address pins and whether each must be high for the chip to answer at `address`."""
        names = [name for name in _SELECTS if name in self.pins]
        offset = address - self.lowest_address
        return tuple((name, bool(offset >> bit & 1)) for bit, name in enumerate(names))


def _ports(*ports: int) -> tuple[str, ...]:
    return tuple(f"P{port}{bit}" for port in ports for bit in range(8))


def _of_24_pins(ground: str, supply: str) -> tuple[str, ...]:
    """Return the pins that PCF8575, PCA9555 and TCA9555 share."""
    return ("INT", "A1", "A2", *_ports(0), ground, *_ports(1), "A0", "SCL", "SDA", supply)


def _of_16_pins() -> tuple[str, ...]:
    """Return the pins of PCF8574 and PCF8574A."""
    return ("A0", "A1", "A2", "P0", "P1", "P2", "P3", "VSS", "P4", "P5", "P6", "P7", "INT", "SCL", "SDA", "VDD")


def _channels(numbers: Sequence[int]) -> tuple[str, ...]:
    return tuple(f"{wire}{number}" for number in numbers for wire in ("SD", "SC"))


_TSSOP24 = "Package_SO:TSSOP-24_4.4x7.8mm_P0.65mm"
_SOIC16 = "Package_SO:SOIC-16W_7.5x10.3mm_P1.27mm"
_PACKAGES = {
    "mcp23017": (
        *("MCP23017-E/SO", "Microchip", "MCP23017_SO", "Package_SO:SOIC-28W_7.5x17.9mm_P1.27mm"),
        (
            *(f"GPB{bit}" for bit in range(8)),
            *("VDD", "VSS", "NC", "SCL", "SDA", "NC", "A0", "A1", "A2", RESET, "INTB", "INTA"),
            *(f"GPA{bit}" for bit in range(8)),
        ),
    ),
    "mcp23008": (
        *("MCP23008-E/SO", "Microchip", "MCP23008-xSO", "Package_SO:SOIC-18W_7.5x11.6mm_P1.27mm"),
        ("SCL", "SDA", "A2", "A1", "A0", RESET, "NC", "INT", "VSS", *(f"GP{bit}" for bit in range(8)), "VDD"),
    ),
    "pcf8574": ("PCF8574T/3,518", "NXP", "PCF8574", _SOIC16, _of_16_pins()),
    "pcf8574a": ("PCF8574AT/3,518", "NXP", "PCF8574A", _SOIC16, _of_16_pins()),
    "pcf8575": ("PCF8575PWR", "Texas Instruments", "PCF8575", _TSSOP24, _of_24_pins("GND", "VCC")),
    "pca9555": ("PCA9555PW,118", "NXP", "PCA9555PW", _TSSOP24, _of_24_pins("VSS", "VDD")),
    "tca9555": ("TCA9555PWR", "Texas Instruments", "TCA9555PWR", _TSSOP24, _of_24_pins("GND", "VCC")),
    "tca6424a": (
        *("TCA6424ARGJR", "Texas Instruments", "TCA6424A"),
        "Package_DFN_QFN:QFN-32-1EP_5x5mm_P0.5mm_EP3.45x3.45mm",
        (*_ports(0, 1, 2), "GND", "ADDR", "VCCP", RESET, "SCL", "SDA", "VCCI", "INT", "EP"),
    ),
}
_DOUBTS = {
    "tca6424a": "the footprint's thermal pad is not confirmed: compare it with the data sheet's RGJ package",
    "pcf8574": "the body's width (7.5 mm) is not confirmed: some sellers' parts have 3.9 mm",
    "pcf8574a": "the body's width (7.5 mm) is not confirmed: some sellers' parts have 3.9 mm",
}
_NOTES = {
    "mcp23017": "GPA7 and GPB7 stay empty: since 2022 they are outputs only",
    "mcp23008": "GP7 stays empty: since 2022 it is an output only",
    "pcf8575": "not the PCF8575C, which has no current sources",
}


def _package(kind: str) -> Package:
    part, maker, symbol, footprint, pins = _PACKAGES[kind]
    note = _DOUBTS.get(kind, _NOTES.get(kind, ""))
    lowest = min(CHIPS[kind].addresses)
    return Package(part, maker, symbol, footprint, pins, lowest, kind != "tca6424a", kind not in _DOUBTS, note)


PACKAGES: Mapping[str, Package] = MappingProxyType({kind: _package(kind) for kind in CHIPS})
MUX = Package(
    part="TCA9548APWR",
    maker="Texas Instruments",
    symbol="TCA9548APWR",
    footprint=_TSSOP24,
    pins=("A0", "A1", RESET, *_channels(range(4)), "GND", *_channels(range(4, 8)), "A2", "SCL", "SDA", "VCC"),
    lowest_address=min(tca9548a.ADDRESSES),
)
