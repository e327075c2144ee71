"""The classifier as a package for every microcontroller ecosystem: Arduino, PlatformIO, ESP-IDF, Zephyr, pico-sdk and
plain CMake. Targets differ in the core whose cost is estimated, not in the files.

Layout and fields of the Arduino library are those of its specification, revision 1.5.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .base import Formula, Target
from .cortex_m import MEMBER as _CORTEX_M

if TYPE_CHECKING:
    from ..classifier import Library
    from ..example import Pins

_VERSION = "1.0.0"

_FUNCTIONS = (
    *("init", "set_switch", "set_code", "lose_switch", "lose_joint"),
    *("classify", "decide", "margin", "probability", "name"),
)
_OF_CODES = ("codes_init", "calibrate", "calibrated", "code_of", "set_reading")
_CONSTANTS = ("CLASSES", "SWITCHES", "JOINTS", "MEMORY", "NAME_BYTES")


@dataclass(frozen=True, kw_only=True)
class Package(Target):
    """A package for a part of a family, or for any part.

    digital, analog  the pins for the example for Arduino: purely digital ones, and those that are also inputs of the
                     converter; (): numbered as on an Uno or a Mega
    """

    digital: tuple[int, ...] = ()
    analog: tuple[int, ...] = ()

    @property
    def example_pins(self) -> "Pins | None":
        """The pins for the example, if they are known."""
        from ..example import Pins

        return Pins(self.part, self.digital, self.analog) if self.digital else None

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text of the package thenar_NAME: the classifier in src/, the files that each ecosystem
        requires, a self test in check/, and an example for Arduino.
        """
        from thenar.firmware_templates.rendering import render

        from ..example import Wiring, example_values
        from ..probes import CHECKS, check_header
        from ..words import comment, inputs_in_words, markdown

        name, names, wiring = library.name, library.names, Wiring.of(library, self.example_pins)
        counts = {"switches": len(names.switches), "joints": len(names.joints)}
        grasps = [comment(grasp) for grasp in names.grasps]
        values = {
            **{"name": name, "version": _VERSION, "thenar": markdown(names.thenar), "checks": CHECKS},
            **{"grasps": grasps, **counts, "wiring": str(wiring), "on_pins": library.sensors.on_pins},
            "sensors": bool(library.sensors.every),
            "known": library.sensors.known,
            "points": [
                (n, *map(markdown, (sensor.name, *sensor.says))) for n, sensor in enumerate(library.sensors.every)
            ],
            "sentence": f"Recognises {len(grasps)} grasp types from {inputs_in_words(**counts)} of a glove.",
            "sources": library.sources,
            "headers": [f"src/{path}" for path in library.whole if path.endswith(".h")],
            "words": _keywords(name, names.segments is not None, bool(library.sensors.every)),
        }
        return {
            **{f"src/{path}": text for path, text in library.whole.items()},
            **{path: render(f"package/{path.rsplit('/', 1)[-1]}.j2", **values) for path in _BESIDE},
            "check/check.c": render("host/check.c.j2", name=name, checks=CHECKS),
            f"check/thenar_{name}_check.h": check_header(name, library.layout, names.grasps),
            "examples/Recognise/Recognise.ino": render(
                "package/Recognise.ino.j2", name=name, **example_values(library, wiring)
            ),
        }

    def said(self, library: "Library") -> str:
        """Return which boards the example fits."""
        from ..example import Wiring

        return str(Wiring.of(library, self.example_pins))


_BESIDE = (
    "library.properties",
    "keywords.txt",
    "library.json",
    "idf_component.yml",
    "zephyr/module.yml",
    "zephyr/Kconfig",
    "CMakeLists.txt",
    "README.md",
    "LICENSE",
)


def _keywords(name: str, segments: bool, codes: bool) -> list[tuple[str, str]]:
    """Return each word of the library with its keyword class in the Arduino editor."""
    own = f"thenar_{name}"
    types = ["thenar", *[f"{own}_codes"] * codes, *["thenar_segmenter"] * segments]
    functions = [f"thenar_{word}" for word in _FUNCTIONS]
    functions += [f"thenar_segment_{word}" for word in ("start", "push")] * segments
    functions += [f"{own}_{word}" for word in _OF_CODES] * codes
    constants = [f"{own}_model", *(f"{own}_{word}".upper() for word in _CONSTANTS)]
    kinds = {"KEYWORD1": types, "KEYWORD2": functions, "LITERAL1": constants}
    return [(word, kind) for kind, words in kinds.items() for word in words]


M0PLUS, M4 = (target.formula for target in _CORTEX_M)
_NEXT = "{folder}/README.md explains how to use it in each ecosystem"
# More only on request: on most parts, flash is read through a cache of 1 to 32 KiB, and larger tables miss it.
_MOST = 64 << 10


def family(name: str, formula: Formula | None, what: str, **given: Any) -> Package:
    """Return a package for parts whose cost is that of a similar core."""
    return Package(name=name, part=name, help=what, most_flash=_MOST, formula=formula, next_step=_NEXT, **given)


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
        M0PLUS,
        "a package for pico-sdk, Arduino, PlatformIO, Zephyr: Raspberry Pi Pico, Cortex-M0+",
        rank=32,
        flash=16 << 20,
        ram=256 << 10,
        digital=tuple(range(23)),
        analog=(26, 27, 28),
    ),
    family(
        "rp2350",
        M4,
        "a package as for rp2040: Raspberry Pi Pico 2, Cortex-M33 or RISC-V",
        rank=33,
        flash=16 << 20,
        ram=512 << 10,
    ),
    family(
        "nrf52",
        M4,
        "a package for Zephyr (nRF Connect), Arduino, PlatformIO: nRF52832, nRF52840, Cortex-M4F",
        rank=34,
        flash=1 << 20,
        ram=64 << 10,
    ),
    family(
        "stm32",
        M4,
        "a package for STM32CubeIDE and any CMSIS project, Zephyr, Arduino, PlatformIO; counted as Cortex-M4",
        rank=35,
        flash=2 << 20,
        ram=20 << 10,
    ),
    family("generic", M4, "a package for any other part that has a C99 compiler; counted as Cortex-M4", rank=36),
)
