"""The chips as parts: pins that the driver knows, and straps that make an address."""

import pytest

from thenar.compiler.glove.packages import GROUND, MUX, PACKAGES, SUPPLY, Package
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.registry import CHIPS

# Read off the data sheets' figures of the packages.
DRAWN = [
    ("mcp23017", {"GPB0": 1, "GPB7": 8, "VDD": 9, "VSS": 10, "SCL": 12, "SDA": 13, "A0": 15, "RESET": 18, "GPA7": 28}),
    ("mcp23008", {"SCL": 1, "SDA": 2, "A2": 3, "A0": 5, "RESET": 6, "INT": 8, "VSS": 9, "GP0": 10, "VDD": 18}),
    ("pcf8574", {"A0": 1, "P0": 4, "P3": 7, "VSS": 8, "P4": 9, "P7": 12, "SCL": 14, "SDA": 15, "VDD": 16}),
    ("pcf8574a", {"A0": 1, "P0": 4, "P3": 7, "VSS": 8, "P4": 9, "P7": 12, "SCL": 14, "SDA": 15, "VDD": 16}),
    ("pcf8575", {"INT": 1, "A1": 2, "P00": 4, "P07": 11, "GND": 12, "P10": 13, "A0": 21, "SCL": 22, "VCC": 24}),
    ("pca9555", {"INT": 1, "A1": 2, "P00": 4, "P07": 11, "VSS": 12, "P10": 13, "A0": 21, "SDA": 23, "VDD": 24}),
    ("tca9555", {"INT": 1, "A2": 3, "P00": 4, "P07": 11, "GND": 12, "P17": 20, "A0": 21, "SDA": 23, "VCC": 24}),
    ("tca6424a", {"P00": 1, "P10": 9, "P27": 24, "GND": 25, "ADDR": 26, "VCCP": 27, "RESET": 28, "VCCI": 31}),
]


@pytest.mark.parametrize(("kind", "pins"), DRAWN, ids=[kind for kind, _ in DRAWN])
def test_pins_have_the_numbers_of_the_data_sheet(kind: str, pins: dict[str, int]) -> None:
    assert {name: int(PACKAGES[kind].number(name)) for name in pins} == pins


def test_the_mux_has_the_pins_of_its_data_sheet() -> None:
    drawn = {"A0": 1, "RESET": 3, "SD0": 4, "SC0": 5, "SC3": 11, "GND": 12, "SD4": 13, "SD7": 19, "A2": 21, "VCC": 24}
    assert {name: int(MUX.number(name)) for name in drawn} == drawn


@pytest.mark.parametrize("kind", list(CHIPS))
def test_every_chip_has_each_pin_of_its_driver_once_and_can_be_powered_and_reached(kind: str) -> None:
    pins = PACKAGES[kind].pins
    assert all(pins.count(name) == 1 for name in (*CHIPS[kind].pins, "SDA", "SCL"))
    assert set(pins) & set(SUPPLY)
    assert set(pins) & set(GROUND)


@pytest.mark.parametrize(
    ("package", "addresses"),
    [*((PACKAGES[kind], CHIPS[kind].addresses) for kind in CHIPS), (MUX, tca9548a.ADDRESSES)],
    ids=[*CHIPS, "tca9548a"],
)
def test_the_straps_of_an_address_are_its_lowest_bits(package: Package, addresses: range) -> None:
    for address in addresses:
        straps = package.selects(address)
        assert sum(1 << bit for bit, (_, high) in enumerate(straps) if high) == address - min(addresses)
    assert len(addresses) == 1 << len(package.selects(min(addresses)))


def test_only_the_chip_without_pull_ups_is_said_to_have_none() -> None:
    assert [kind for kind in CHIPS if not PACKAGES[kind].pulls_up] == ["tca6424a"]
