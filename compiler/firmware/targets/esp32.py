"""Espressif's chips with Wi-Fi: one record of pins for each.

Pins and channels are those of the GPIO tables of the ESP-IDF Programming Guide, default pins those of arduino-esp32
(variants/*/pins_arduino.h). A pin that some chips or modules of the name lack or use themselves is refused.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from .package import M4, family
from .riscv import MEMBER as _RISCV
from .sketch import SketchPart, gpio

_STRAPPING = "it is a strapping pin, which the chip reads at reset"
_FLASH = "the flash or the PSRAM uses it"
_USB = "the USB port uses it"
_NO_PULL_UP = "it has no pull-up"
_ADC2_IN_WIFI = "ADC2 does not convert while Wi-Fi is on"


def _tied(reasons: Mapping[str, Iterable[int]], adc2: str, channels: int) -> dict[str, str]:
    """Return the reason of every pin that cannot be used, and of `channels` channels of ADC2."""
    pins = {pin: reason for reason, numbers in reasons.items() for pin in gpio(*numbers)}
    return pins | {f"ADC2_CH{channel}": adc2 for channel in range(channels)}


def _esp(name: str, what: str, **given: Any) -> SketchPart:
    shared = {
        "rank": 31,
        "flash": 16 << 20,
        "ram": 256 << 10,
        "code_bits": 12,
        "wireless": True,
        "conversion_us": 100,
        "arduino_core": "arduino-esp32",
        "fqbn": f"esp32:esp32:{name}",
        "platform": "espressif32",
    }
    return family(SketchPart, name, given.pop("formula", M4), what, **{**shared, **given})


# GPIO16 and 17 are a WROVER's PSRAM. Pins of bus and UARTs are the core's defaults except those of UART 1, which share
# the flash's: any others will do, since the part has a pin matrix.
_ESP32_ADC = {"ADC1_CH0": 36, "ADC1_CH3": 39, "ADC1_CH4": 32, "ADC1_CH5": 33, "ADC1_CH6": 34, "ADC1_CH7": 35}
_ESP32 = _esp(
    "esp32",
    "a package for ESP-IDF, Arduino, PlatformIO, Zephyr: ESP32 (Xtensa); or a sketch",
    pins=gpio(4, 5, 13, 14, 16, 17, 18, 19, 21, 22, 23, 25, 26, 27, 32, 33),
    uarts=(gpio(3, 1), gpio(26, 27), gpio(16, 17)),
    twi=gpio(21, 22),
    analog={channel: f"GPIO{pin}" if pin < 34 else "" for channel, pin in _ESP32_ADC.items()},
    converter=_ESP32_ADC,
    reference="about 3.1 V",
    pio_board="esp32dev",
    tied=_tied(
        {_STRAPPING: (0, 2, 12, 15), _FLASH: range(6, 12), _NO_PULL_UP: range(34, 40)}, _ADC2_IN_WIFI, channels=10
    ),
)

_S2_ADC = {f"ADC1_CH{channel}": channel + 1 for channel in range(10)}
_ESP32S2 = _esp(
    "esp32s2",
    "a package as for esp32: ESP32-S2 (Xtensa); or a sketch",
    pins=gpio(*range(1, 19), 21, *range(33, 43)),
    uarts=(gpio(44, 43), gpio(18, 17)),
    twi=gpio(8, 9),
    analog={channel: f"GPIO{pin}" for channel, pin in _S2_ADC.items()},
    converter=_S2_ADC,
    reference="about 2.5 V",
    pio_board="esp32-s2-saola-1",
    usb=gpio(19, 20),
    tied=_tied({_STRAPPING: (0, 45, 46), _FLASH: range(26, 33), _USB: (19, 20)}, _ADC2_IN_WIFI, channels=10),
)

# GPIO33 to 37 are the octal PSRAM's of many modules; 47 and 48 have 1.8 V where their supply is 1.8 V (ESP32-S3R8V).
_S3_ADC = {f"ADC1_CH{channel}": channel + 1 for channel in range(10)}
_ESP32S3 = _esp(
    "esp32s3",
    "a package as for esp32: ESP32-S3 (Xtensa); or a sketch",
    pins=gpio(1, 2, *range(4, 19), 21, *range(38, 43)),
    uarts=(gpio(44, 43), gpio(18, 17), gpio(16, 15)),
    twi=gpio(8, 9),
    analog={channel: f"GPIO{pin}" for channel, pin in _S3_ADC.items()},
    converter=_S3_ADC,
    reference="about 3.1 V",
    pio_board="esp32-s3-devkitc-1",
    usb=gpio(19, 20),
    tied=_tied(
        {
            _STRAPPING: (0, 3, 45, 46),
            _FLASH: range(26, 33),
            "octal flash or PSRAM uses it on many modules": range(33, 38),
            _USB: (19, 20),
            "some chips drive it at 1.8 V": (47, 48),
        },
        _ADC2_IN_WIFI,
        channels=10,
    ),
)

# The core's bus is at two strapping pins, and its UART 1 at the USB's: this one has the bus of a XIAO ESP32C3.
_C3_ADC = {f"ADC1_CH{channel}": channel for channel in range(5)}
_ESP32C3 = _esp(
    "esp32c3",
    "a package as for esp32: ESP32-C3 (RISC-V); or a sketch",
    formula=_RISCV.formula,
    pins=gpio(0, 1, 3, 4, 5, 6, 7, 10),
    uarts=(gpio(20, 21), gpio(10, 5)),
    twi=gpio(6, 7),
    analog={channel: f"GPIO{pin}" for channel, pin in _C3_ADC.items()},
    converter=_C3_ADC,
    reference="about 2.5 V",
    pio_board="esp32-c3-devkitm-1",
    usb=gpio(18, 19),
    tied=_tied(
        {_STRAPPING: (2, 8, 9), _FLASH: range(12, 18), _USB: (18, 19), "it supplies the flash with power": (11,)},
        "ADC2 of this chip gives wrong results",
        channels=1,
    ),
)

# The core's UART 1 is at two strapping pins. PlatformIO's own platform has no Arduino core for this chip.
_C6_ADC = {f"ADC1_CH{channel}": channel for channel in range(7)}
_ESP32C6 = _esp(
    "esp32c6",
    "a package as for esp32: ESP32-C6, H2 (RISC-V); or a sketch for ESP32-C6",
    formula=_RISCV.formula,
    pins=gpio(0, 1, 2, 3, 6, 7, *range(18, 24)),
    uarts=(gpio(17, 16), gpio(18, 19)),
    twi=gpio(23, 22),
    analog={channel: f"GPIO{pin}" for channel, pin in _C6_ADC.items()},
    converter=_C6_ADC,
    reference="the converter's full scale",
    platform="https://github.com/pioarduino/platform-espressif32/releases/download/stable/platform-espressif32.zip",
    pio_board="esp32-c6-devkitc-1",
    usb=gpio(12, 13),
    tied=_tied(
        {
            _STRAPPING: (4, 5, 8, 9, 15),
            _FLASH: range(24, 31),
            _USB: (12, 13),
            "chips with flash in their package lack it": (10, 11),
            "chips without flash in their package lack it": (14,),
        },
        "",
        channels=0,
    ),
)

MEMBER = (_ESP32, _ESP32S2, _ESP32S3, _ESP32C3, _ESP32C6)
