"""The pins of Espressif's chips, against the GPIO tables of the ESP-IDF Programming Guide."""

import pytest

from thenar.compiler.firmware.targets.package import MEMBER as PACKAGES

PARTS = {part.part: part for part in PACKAGES if part.part.startswith("esp")}
# Of each chip: its GPIOs, those with the comment "strapping pin", "SPI0/1", "USB" or "GPI", and those of ADC1. Some
# modules lack or use the doubtful ones. GPIO5 of an ESP32 only sets the timing of SDIO.
TABLES: dict[str, dict[str, set[int]]] = {
    "esp32": {
        "there": {*range(20), 21, 22, 23, 25, 26, 27, *range(32, 40)},
        "special": {0, 2, 12, 15, *range(6, 12), 1, 3},
        "inputs": {*range(34, 40)},
        "adc1": {*range(32, 40)},
        "doubtful": {37, 38},
    },
    "esp32s2": {
        "there": {*range(22), *range(26, 47)},
        "special": {0, 45, 46, *range(26, 33), 19, 20, 43, 44},
        "adc1": {*range(1, 11)},
    },
    "esp32s3": {
        "there": {*range(22), *range(26, 49)},
        "special": {0, 3, 45, 46, *range(26, 38), 19, 20, 43, 44},
        "adc1": {*range(1, 11)},
        "doubtful": {47, 48},
    },
    "esp32c3": {
        "there": {*range(22)},
        "special": {2, 8, 9, *range(12, 18), 18, 19, 20, 21},
        "adc1": {*range(5)},
        "doubtful": {11},
    },
    "esp32c6": {
        "there": {*range(31)},
        "special": {4, 5, 8, 9, 15, *range(24, 31), 12, 13, 16, 17},
        "adc1": {*range(7)},
        "doubtful": {10, 11, 14},
    },
}


@pytest.mark.parametrize("name", TABLES)
def test_example_pins_are_free_and_analog_ones_on_adc1(name: str) -> None:
    part, table = PARTS[name], TABLES[name]
    free = table["there"] - table["special"] - table.get("doubtful", set())
    assert len({*part.digital, *part.analog}) == len(part.digital) + len(part.analog)
    assert set(part.analog) == free & table["adc1"]
    assert set(part.digital) == free - table["adc1"] - table.get("inputs", set())
