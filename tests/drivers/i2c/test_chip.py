import pytest

from thenar.drivers.errors import SettingError
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import CHIPS, ChipPackage, Conversion, Write, expanders
from thenar.drivers.i2c.chips.base import GROUND, SUPPLY

# Bytes on the wire and SCL periods of one read of all pins, as the data sheets draw them.
WHOLE_READS = {
    "pcf8574": (2, 20),
    "pcf8574a": (2, 20),
    "pcf8575": (3, 29),
    "mcp23008": (4, 39),
    "mcp23017": (5, 48),
    "pca9555": (5, 48),
    "tca9555": (5, 48),
    "tca6424a": (6, 57),
}

# One pin of an ADS1115 goes to four nets.
STRAPPED = {kind: chip for kind, chip in CHIPS.items() if kind != "ads1115"}

# Read off the data sheets' figures of the packages.
DRAWN = [
    ("mcp23017", {"GPB0": 1, "GPB7": 8, "VDD": 9, "VSS": 10, "SCL": 12, "SDA": 13, "A0": 15, "RESET": 18, "GPA7": 28}),
    ("mcp23008", {"SCL": 1, "SDA": 2, "A2": 3, "A0": 5, "RESET": 6, "INT": 8, "VSS": 9, "GP0": 10, "VDD": 18}),
    ("pcf8574", {"A0": 1, "P0": 4, "P3": 7, "VSS": 8, "P4": 9, "P7": 12, "SCL": 14, "SDA": 15, "VDD": 16}),
    ("pcf8574a", {"A0": 1, "P0": 4, "P3": 7, "VSS": 8, "P4": 9, "P7": 12, "SCL": 14, "SDA": 15, "VDD": 16}),
    ("pcf8575", {"INT": 1, "A1": 2, "P00": 4, "P07": 11, "GND": 12, "P10": 13, "A0": 21, "SCL": 22, "VCC": 24}),
    ("pca9555", {"INT": 1, "A1": 2, "P00": 4, "P07": 11, "VSS": 12, "P10": 13, "A0": 21, "SDA": 23, "VDD": 24}),
    ("tca9555", {"INT": 1, "A2": 3, "P00": 4, "P07": 11, "GND": 12, "P17": 20, "A0": 21, "SDA": 23, "VCC": 24}),
    ("ads1115", {"ADDR": 1, "GND": 3, "AIN0": 4, "AIN3": 7, "VDD": 8, "SDA": 9, "SCL": 10}),
    ("ads7828", {"CH0": 1, "CH7": 8, "GND": 9, "REF": 10, "COM": 11, "A0": 12, "A1": 13, "SCL": 14, "VDD": 16}),
    ("tca6424a", {"P00": 1, "P10": 9, "P27": 24, "GND": 25, "ADDR": 26, "VCCP": 27, "RESET": 28, "VCCI": 31}),
]


@pytest.mark.parametrize("kind", expanders())
def test_reading_all_pins_takes_what_the_data_sheets_say(kind: str) -> None:
    chip = CHIPS[kind]
    whole = [reading for reading in chip.readings if sorted(reading.pins) == list(range(len(chip.pins)))]
    assert [(reading.wire_bytes, reading.scl_periods) for reading in whole] == [WHOLE_READS[kind]]


@pytest.mark.parametrize("kind", CHIPS)
def test_the_cheapest_readings_stand_first_and_have_names_of_their_own(kind: str) -> None:
    readings = CHIPS[kind].readings
    assert [r.scl_periods for r in readings] == sorted(r.scl_periods for r in readings)
    assert len({r.name for r in readings}) == len(readings)


@pytest.mark.parametrize("kind", CHIPS)
def test_pin_names_are_unique_and_every_pin_is_read(kind: str) -> None:
    chip = CHIPS[kind]
    assert len(set(chip.pins)) == len(chip.pins)
    assert {pin for reading in chip.readings for pin in reading.pins} - {-1} == set(range(len(chip.pins)))


@pytest.mark.parametrize(("kind", "pins"), [("mcp23017", {"GPA7", "GPB7"}), ("mcp23008", {"GP7"})])
def test_a_microchip_expanders_seventh_pins_are_no_inputs(kind: str, pins: set[str]) -> None:
    chip = CHIPS[kind]
    assert set(chip.not_inputs) == pins
    assert all("SDA" in reason for reason in chip.not_inputs.values())


@pytest.mark.parametrize("kind", CHIPS)
def test_an_address_that_such_a_chip_cannot_have_is_refused(kind: str) -> None:
    chip = CHIPS[kind]
    for address in range(128):
        if address in chip.addresses:
            chip.check_address(address)
        else:
            with pytest.raises(SettingError, match=f"{kind} is at 0x.*not at 0x{address:02X}"):
                chip.check_address(address)


def test_what_was_written_holds_in_the_bits_that_count() -> None:
    write = Write(b"\x00\xff", b"\x00\x00", b"\xff\x00")
    assert write.holds(b"\x00\xa5")
    assert not write.holds(b"\x01\x00")
    assert not write.holds(b"\x00")
    assert Write(b"\x0a\x04", b"\x04").holds(b"\x04")


@pytest.mark.parametrize(("kind", "pins"), DRAWN, ids=[kind for kind, _ in DRAWN])
def test_pins_have_the_numbers_of_the_data_sheet(kind: str, pins: dict[str, int]) -> None:
    assert {name: int(CHIPS[kind].package.number(name)) for name in pins} == pins


def test_the_mux_has_the_pins_of_its_data_sheet() -> None:
    drawn = {"A0": 1, "RESET": 3, "SD0": 4, "SC0": 5, "SC3": 11, "GND": 12, "SD4": 13, "SD7": 19, "A2": 21, "VCC": 24}
    assert {name: int(tca9548a.PACKAGE.number(name)) for name in drawn} == drawn


@pytest.mark.parametrize("kind", list(CHIPS))
def test_every_chips_package_has_its_drivers_pins_supply_and_bus(kind: str) -> None:
    pins = CHIPS[kind].package.pins
    assert all(pins.count(name) == 1 for name in (*CHIPS[kind].pins, "SDA", "SCL"))
    assert set(pins) & set(SUPPLY)
    assert set(pins) & set(GROUND)


@pytest.mark.parametrize(
    ("package", "addresses"),
    [
        *((chip.package, chip.addresses) for chip in STRAPPED.values()),
        (tca9548a.PACKAGE, tca9548a.ADDRESSES),
    ],
    ids=[*STRAPPED, "tca9548a"],
)
def test_the_straps_of_an_address_are_its_lowest_bits(package: ChipPackage, addresses: range) -> None:
    for address in addresses:
        straps = package.selects(address - min(addresses))
        assert sum(1 << bit for bit, (_, to) in enumerate(straps) if to == "high") == address - min(addresses)
    assert len(addresses) == 1 << len(package.selects(0))


def test_an_ads1115s_address_pin_goes_to_ground_supply_sda_or_scl() -> None:
    package = CHIPS["ads1115"].package
    assert [package.selects(offset) for offset in range(4)] == [(("ADDR", to),) for to in ("low", "high", "SDA", "SCL")]


@pytest.mark.parametrize(("kind", "start", "read", "us"), [("ads1115", 38, 48, 1317), ("ads7828", 0, 48, 0)])
def test_a_conversion_takes_what_the_data_sheet_says(kind: str, start: int, read: int, us: float) -> None:
    for conversion in CHIPS[kind].readings:
        assert isinstance(conversion, Conversion)
        assert (conversion.start_periods, conversion.scl_periods, conversion.us) == (start, read, us)
