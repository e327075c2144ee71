"""The classifier as a package for every microcontroller ecosystem: Arduino, PlatformIO, ESP-IDF, Zephyr, pico-sdk and
plain CMake. Targets differ in the core whose cost is estimated, and in the pins of the example, not in the files.

Layout and fields of the Arduino library are those of its specification, revision 1.5.
"""

from dataclasses import dataclass
from functools import partial
from itertools import count, islice
from typing import TYPE_CHECKING, Any

from thenar.firmware_templates.rendering import render

from .base import Formula, Target
from .cores import M0PLUS, M4, RV32

if TYPE_CHECKING:
    from ..classifier import Library

_VERSION = "1.0.0"
_BESIDE = (
    "library.properties",
    "library.json",
    "idf_component.yml",
    "zephyr/module.yml",
    "CMakeLists.txt",
    "README.md",
    "LICENSE",
)

# On Arduino's boards, pins 0 and 1 are those of the serial port, and 13 that of the LED.
_FIRST, _LED = 2, 13
_ON_MULTIPLEXER, _ON_REGISTER = 16, 8
_ADDRESS_PINS, _REGISTER_PINS = 4, 3  # S0 to S3; PL, CP and Q7


@dataclass(frozen=True, kw_only=True)
class Package(Target):
    """A package for a part of a family, or for any part.

    digital, analog  the pins for the example for Arduino: purely digital ones, and those that are also inputs of the
                     converter; (): numbered as on an Uno or a Mega
    """

    digital: tuple[int, ...] = ()
    analog: tuple[int, ...] = ()

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text of the package thenar_NAME: the classifier in src/, the files that each ecosystem
        requires, a self test in check/, and an example for Arduino.
        """
        from ..probes import CHECKS, check_header
        from ..words import inputs_in_words, markdown

        name, names, sensors = library.name, library.names, library.sensors
        inputs = inputs_in_words(len(names.switches), len(names.joints))
        values = {
            "name": name,
            "version": _VERSION,
            "thenar": markdown(names.thenar),
            "checks": CHECKS,
            "switches": names.switches,
            "sensors": sensors,
            "points": [(n, *map(markdown, (sensor.name, *sensor.says))) for n, sensor in enumerate(sensors.every)],
            "sentence": f"Recognises {len(names.grasps)} grasp types from {inputs} of a glove.",
            "sources": library.sources,
            "headers": [f"src/{path}" for path in library.whole if path.endswith(".h")],
        }
        return {
            **{f"src/{path}": text for path, text in library.whole.items()},
            **{path: render(f"package/{path.rsplit('/', 1)[-1]}.j2", **values) for path in _BESIDE},
            "check/check.c": render("host/check.c.j2", name=name, checks=CHECKS),
            f"check/thenar_{name}_check.h": check_header(name, library.layout),
            "examples/Recognise/Recognise.ino": render("package/Recognise.ino.j2", **self.example_values(library)),
        }

    def example_values(self, library: "Library") -> dict[str, Any]:
        """Return the values for the example, which chooses by the macros of a board what is to be on which pin."""
        from ..words import comment

        sensors = library.sensors
        said = [comment(f"{sensor.name}: {' and '.join(sensor.says)}") for sensor in sensors.every]
        plain = [number for number, switch in enumerate(library.names.switches) if switch.threshold is None]
        names = [comment(library.names.switches[number].name) for number in plain]
        # In the order of their use; on a known part, analog pins from the last on follow the digital ones.
        usable = (*self.digital, *reversed(self.analog)) if self.digital else (n for n in count(_FIRST) if n != _LED)
        pins = list(islice(usable, len(names) + _ADDRESS_PINS + _REGISTER_PINS))
        analog = [*map(str, self.analog)] if self.digital else [f"A{number}" for number in range(len(said))]
        analog += ["0"] * (len(said) - len(analog))  # multiplexers replace the rest

        def needed(pins_of_inputs: int) -> int:
            """Return how many pins a known part needs for as many; otherwise the least that a board must have."""
            return pins_of_inputs if self.digital else max(pins[:pins_of_inputs], default=0) + 1

        return {
            "name": library.name,
            "part": self.named if self.digital else None,
            "part_analog": len(self.analog),
            "part_pins": len(self.digital) + len(self.analog),
            "switches": list(zip(plain, pins + [-1] * len(names), names, strict=False)),
            "registers": -(-len(names) // _ON_REGISTER),
            "sensors": list(zip(analog, said, strict=False)),
            "multiplexers": -(-len(said) // _ON_MULTIPLEXER),
            "sorts": "taxels" if not sensors.joints and sensors.taxels else "joints",
            "on_pins": sensors.on_pins,
            "needed": needed(len(names)),
            "needed_multiplexed": needed(len(names) + _ADDRESS_PINS),
            "needed_at_least": needed(_REGISTER_PINS + _ADDRESS_PINS),
            "register_pins": pins[:_REGISTER_PINS],
            "address_pins": pins[len(names) :][:_ADDRESS_PINS],
            "address_pins_behind_registers": pins[_REGISTER_PINS:][:_ADDRESS_PINS],
            "output_pins": analog[: -(-len(said) // _ON_MULTIPLEXER)],
        }


_NEXT = "{folder}/README.md explains how to use it in each ecosystem"
# More only on request: on most parts, flash is read through a cache of 1 to 32 KiB, and larger tables miss it.
_MOST = 64 << 10


def family(name: str, what: str, formula: Formula | None = M4, **given: Any) -> Package:
    """Return a package for parts whose cost is that of a similar core."""
    return Package(name=name, part=name, help=what, most_flash=_MOST, formula=formula, next_step=_NEXT, **given)


# Espressif's pins are those of the GPIO tables of the ESP-IDF Programming Guide. Left out are pins for strapping, for
# the flash, the PSRAM or the USB port, without a pull-up (which only analog inputs may lack), or missing on some chips
# or modules. Analog pins are those of ADC1, since ADC2 does not convert while Wi-Fi is on.
_esp = partial(family, rank=31, flash=16 << 20, ram=256 << 10)
# Flash is that of a family's largest usual part, RAM that of its smallest.
MEMBER = (
    Package(
        name="arduino",
        part="arduino",
        help="a package for Arduino's boards, AVR or other; for the smallest part that holds the build",
        next_step="copy it into `libraries` of your sketchbook; {folder}/README.md lists other build systems",
        rank=30,
        any_part=True,
    ),
    # RP2040 datasheet, Pico W datasheet: the module uses 23, 24, 25 and 29 itself.
    family(
        "rp2040",
        "a package for pico-sdk, Arduino, PlatformIO, Zephyr: Raspberry Pi Pico, Cortex-M0+",
        M0PLUS,
        rank=32,
        flash=16 << 20,
        ram=256 << 10,
        digital=tuple(range(23)),
        analog=(26, 27, 28),
    ),
    family(
        "rp2350",
        "a package as for rp2040: Raspberry Pi Pico 2, Cortex-M33 or RISC-V",
        rank=33,
        flash=16 << 20,
        ram=512 << 10,
    ),
    family(
        "nrf52",
        "a package for Zephyr (nRF Connect), Arduino, PlatformIO: nRF52832, nRF52840, Cortex-M4F",
        rank=34,
        flash=1 << 20,
        ram=64 << 10,
    ),
    family(
        "stm32",
        "a package for STM32CubeIDE and any CMSIS project, Zephyr, Arduino, PlatformIO; counted as Cortex-M4",
        rank=35,
        flash=2 << 20,
        ram=20 << 10,
    ),
    family("generic", "a package for any other part that has a C99 compiler; counted as Cortex-M4", rank=36),
    # GPIO16 and 17 are a WROVER's PSRAM, but free on the usual WROOM-32.
    _esp(
        "esp32",
        "a package for ESP-IDF, Arduino, PlatformIO, Zephyr: ESP32 (Xtensa)",
        digital=(4, 5, 13, 14, *range(16, 20), 21, 22, 23, 25, 26, 27),
        analog=(36, 39, 32, 33, 34, 35),
    ),
    _esp(
        "esp32s2",
        "a package as for esp32: ESP32-S2 (Xtensa)",
        digital=(*range(11, 19), 21, *range(33, 43)),
        analog=tuple(range(1, 11)),
    ),
    # GPIO33 to 37 are the octal PSRAM's of many modules; 47 and 48 have 1.8 V on an ESP32-S3R8V.
    _esp(
        "esp32s3",
        "a package as for esp32: ESP32-S3 (Xtensa)",
        digital=(*range(11, 19), 21, *range(38, 43)),
        analog=(1, 2, *range(4, 11)),
    ),
    _esp(
        "esp32c3",
        "a package as for esp32: ESP32-C3 (RISC-V)",
        formula=RV32,
        digital=(5, 6, 7, 10),
        analog=(0, 1, 3, 4),
    ),
    _esp(
        "esp32c6",
        "a package as for esp32: ESP32-C6, H2 (RISC-V)",
        formula=RV32,
        digital=(7, *range(18, 24)),
        analog=(0, 1, 2, 3, 6),
    ),
)
