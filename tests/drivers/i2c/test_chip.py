import pytest

from thenar.drivers.errors import SettingError
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chip import Chip, Write
from thenar.drivers.i2c.registry import CHIPS

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


@pytest.mark.parametrize("kind", CHIPS)
def test_reading_all_pins_takes_what_the_data_sheets_say(kind: str) -> None:
    chip = CHIPS[kind]
    whole = [reading for reading in chip.readings if sorted(reading.pins) == list(range(len(chip.pins)))]
    assert [(reading.wire_bytes, reading.scl_periods) for reading in whole] == [WHOLE_READS[kind]]


def test_selecting_a_channel_takes_what_the_data_sheet_says() -> None:
    assert (tca9548a.WIRE_BYTES, tca9548a.SCL_PERIODS) == (2, 9 * 2 + 2)


@pytest.mark.parametrize("kind", CHIPS)
def test_the_cheapest_readings_stand_first_and_have_names_of_their_own(kind: str) -> None:
    readings = CHIPS[kind].readings
    assert [r.scl_periods for r in readings] == sorted(r.scl_periods for r in readings)
    assert len({r.name for r in readings}) == len(readings)


@pytest.mark.parametrize("kind", CHIPS)
def test_pins_have_names_of_their_own_and_every_pin_is_in_some_reading(kind: str) -> None:
    chip = CHIPS[kind]
    assert len(set(chip.pins)) == len(chip.pins)
    assert {pin for reading in chip.readings for pin in reading.pins} == set(range(len(chip.pins)))


@pytest.mark.parametrize(("kind", "pins"), [("mcp23017", {"GPA7", "GPB7"}), ("mcp23008", {"GP7"})])
def test_the_seventh_pins_of_a_microchip_expander_are_no_inputs_and_the_reason_is_given(
    kind: str, pins: set[str]
) -> None:
    chip = CHIPS[kind]
    assert set(chip.not_inputs) == pins
    assert all("SDA" in reason for reason in chip.not_inputs.values())


@pytest.mark.parametrize("kind", sorted(set(CHIPS) - {"mcp23017", "mcp23008"}))
def test_all_pins_of_the_others_are_inputs(kind: str) -> None:
    assert not CHIPS[kind].not_inputs


@pytest.mark.parametrize("kind", CHIPS)
def test_an_address_that_such_a_chip_cannot_have_is_refused(kind: str) -> None:
    chip: type[Chip] = CHIPS[kind]
    for address in range(128):
        if address in chip.addresses:
            assert chip(address).address == address
        else:
            with pytest.raises(SettingError, match=f"{kind} answers at 0x.*not at 0x{address:02X}"):
                chip(address)


def test_what_was_written_holds_in_the_bits_that_count() -> None:
    write = Write(b"\x00\xff", b"\x00\x00", b"\xff\x00")
    assert write.holds(b"\x00\xa5")
    assert not write.holds(b"\x01\x00")
    assert not write.holds(b"\x00")
    assert Write(b"\x0a\x04", b"\x04").holds(b"\x04")
