"""The pins of Espressif's chips, against the GPIO tables of the ESP-IDF Programming Guide."""

import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.board import parse_board
from thenar.compiler.firmware.targets import wired
from thenar.compiler.firmware.targets.esp32 import MEMBER
from thenar.compiler.firmware.targets.sketch import SketchPart, gpio

PARTS = {part.part: part for part in MEMBER}
# Of each chip: its GPIOs, those with the comment "strapping pin", "SPI0/1", "USB" or "GPI", and those of ADC1.
TABLES = {
    "esp32": {
        "there": {*range(20), 21, 22, 23, 25, 26, 27, *range(32, 40)},
        "strapping": {0, 2, 5, 12, 15},
        "flash": {*range(6, 12), 16, 17},
        "inputs": {*range(34, 40)},
        "adc1": [36, 37, 38, 39, 32, 33, 34, 35],
    },
    "esp32s2": {
        "there": {*range(22), *range(26, 47)},
        "strapping": {0, 45, 46},
        "flash": {*range(26, 33)},
        "usb": {19, 20},
        "inputs": {46},
        "adc1": [*range(1, 11)],
    },
    "esp32s3": {
        "there": {*range(22), *range(26, 49)},
        "strapping": {0, 3, 45, 46},
        "flash": {*range(26, 38)},
        "usb": {19, 20},
        "adc1": [*range(1, 11)],
    },
    "esp32c3": {
        "there": {*range(22)},
        "strapping": {2, 8, 9},
        "flash": {*range(12, 18)},
        "usb": {18, 19},
        "adc1": [*range(5)],
    },
    "esp32c6": {
        "there": {*range(31)},
        "strapping": {4, 5, 8, 9, 15},
        "flash": {*range(24, 31)},
        "usb": {12, 13},
        "adc1": [*range(7)],
    },
}
# GPIO5 of an ESP32 only sets the timing of SDIO; 16 and 17 are a WROVER's PSRAM, but free on the usual WROOM-32.
FREE = {"esp32": {5, 16, 17}}
DOUBTFUL = {"esp32s3": {47, 48}, "esp32c3": {11}, "esp32c6": {10, 11, 14}}


def numbers(pins: object) -> set[int]:
    """Return the numbers of such names."""
    assert isinstance(pins, tuple | dict)
    return {int(pin.removeprefix("GPIO")) for pin in pins if pin.startswith("GPIO")}


@pytest.mark.parametrize("name", TABLES)
def test_every_pin_of_the_table_is_usable_or_refused_with_a_reason(name: str) -> None:
    part, table = PARTS[name], TABLES[name]
    special = set().union(*(table.get(kind, set()) for kind in ("strapping", "flash", "usb", "inputs")))
    usable, refused, hosts = numbers(part.pins), numbers(dict(part.tied)), numbers(part.uarts[0])
    assert usable | refused | hosts == table["there"]
    assert not usable & refused
    assert usable & (special | DOUBTFUL.get(name, set())) == FREE.get(name, set())
    assert refused == (special | DOUBTFUL.get(name, set()) & set(table["there"])) - FREE.get(name, set())
    assert numbers(part.usb) == table.get("usb", set())
    assert len(set(part.pins)) == len(part.pins)


@pytest.mark.parametrize("name", TABLES)
def test_channels_are_those_of_adc1_at_their_pins(name: str) -> None:
    part, adc1 = PARTS[name], TABLES[name]["adc1"]
    assert isinstance(adc1, list)
    assert {int(channel.removeprefix("ADC1_CH")): pin for channel, pin in part.converter.items()}.items() <= dict(
        enumerate(adc1)
    ).items()
    assert set(part.analog) == set(part.converter)
    assert all(at in ("", f"GPIO{part.converter[channel]}") for channel, at in part.analog.items())


@pytest.mark.parametrize("part", [part for part in wired().values() if isinstance(part, SketchPart)])
def test_bus_and_uarts_have_usable_pins_of_their_own(part: SketchPart) -> None:
    used = [pin for pins in (*part.uarts[1:], part.twi) for pin in pins]
    assert len(set(used)) == len(used)
    assert set(used) <= set(part.pins)


@pytest.mark.parametrize(
    ("part", "wiring", "message"),
    [
        ("esp32", 'GPIO12"', "GPIO12 of an esp32 cannot be used: it is a strapping pin, which the chip reads at reset"),
        ("esp32", 'GPIO34"', "GPIO34 of an esp32 cannot be used: it has no pull-up"),
        ("esp32s2", 'GPIO45"', "GPIO45 of an esp32s2 cannot be used: it is a strapping pin"),
        ("esp32s2", 'GPIO26"', "GPIO26 of an esp32s2 cannot be used: the flash or the PSRAM uses it"),
        ("esp32s2", 'GPIO22"', "an esp32s2 has no usable pin 'GPIO22'"),
        ("esp32s3", 'GPIO43"', "GPIO43 is already a pin of UART 0 (the host's)"),
        ("esp32s3", 'GPIO35"', "GPIO35 of an esp32s3 cannot be used: octal flash or PSRAM uses it on many modules"),
        ("esp32s3", 'GPIO48"', "GPIO48 of an esp32s3 cannot be used: some chips drive it at 1.8 V"),
        ("esp32c3", 'GPIO19"', "GPIO19 of an esp32c3 cannot be used: the USB port uses it"),
        ("esp32c3", 'GPIO11"', "GPIO11 of an esp32c3 cannot be used: it supplies the flash with power"),
        ("esp32c6", 'GPIO14"', "GPIO14 of an esp32c6 cannot be used: chips without flash in their package lack it"),
        ("esp32c6", 'GPIO31"', "an esp32c6 has no usable pin 'GPIO31'"),
        ("esp32", 'GPIO4"\n[analog]\nj = "ADC2_CH0"', "ADC2_CH0 of an esp32 cannot be used: ADC2 does not convert"),
        ("esp32s3", 'GPIO4"\n[analog]\nj = "ADC1_CH2"', "GPIO3 of an esp32s3 cannot be used: it is a strapping pin"),
        ("esp32s3", 'GPIO4"\n[analog]\nj = "ADC1_CH3"', "analog.j: GPIO4 is already the pin of pins.a"),
        ("esp32c3", 'GPIO4"\n[analog]\nj = "ADC2_CH0"', "ADC2_CH0 of an esp32c3 cannot be used: ADC2 of this chip"),
        ("esp32c6", 'GPIO3"\n[analog]\nj = "ADC2_CH0"', "an esp32c6 has no channel 'ADC2_CH0'"),
        ("esp32c6", 'GPIO3"\n[taxels]\ninputs = ["ADC1_CH7"]\nnames = ["t"]', "has no channel 'ADC1_CH7'"),
        ("esp32c3", 'GPIO6"\n[cyberglove]\nuart = 2', "an esp32c3 has no UART 2: use 1"),
        ("esp32s2", 'GPIO18"\n[cyberglove]', "GPIO18 is already a pin of UART 1 (the glove's)"),
        ("esp32-s3", 'GPIO4"', "part: 'esp32-s3' is not one of its values (did you mean 'esp32s3'"),
    ],
)
def test_a_pin_or_channel_that_cannot_be_used_is_refused_with_the_reason(part: str, wiring: str, message: str) -> None:
    with pytest.raises(FirmwareError) as caught:
        parse_board(f'part = "{part}"\n[pins]\na = "{wiring}\n')
    assert message in str(caught.value)


def test_names_of_pins_are_those_of_the_data_sheet() -> None:
    assert gpio(0, 21) == ("GPIO0", "GPIO21")
