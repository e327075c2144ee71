"""The classifier as a package that every ecosystem of microcontrollers takes: Arduino, PlatformIO, ESP-IDF, Zephyr,
pico-sdk and plain CMake. Targets differ in the core that the layout is chosen for, and not in what is written.

Layout and fields of the Arduino library are those of its specification, revision 1.5.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ..costs import Core
from ..tools import XTENSA_COMPILER, XTENSA_EMULATOR
from .bare import Bare, Machine
from .base import Target
from .cortex_m import MEMBER as _CORTEX_M

if TYPE_CHECKING:
    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Answers, Frames, Lost

_VERSION = "1.0.0"
_LED = 13  # has the board's LED and its resistor to ground, which outdo a pull-up on some boards
_FIRST_PIN = 2  # 0 and 1 are the serial port's

_TYPES = ("class", "switch", "code")
_FUNCTIONS = ("init", "set_switch", "classify", "update", "margin", "probability", "grasp")
_CONSTANTS = ("CLASSES", "SWITCHES", "PORTS", "JOINTS")


@dataclass(frozen=True, kw_only=True)
class Package(Target):
    """A package for a part of a family, or for any part.

    like   the target on whose core it is counted what the classifier takes, if there is one
    """

    like: Target | None = None

    @property
    def counted_on(self) -> str:
        """The core that counts, and for what."""
        return self.part if self.like is None else f"{self.like.part}, for {self.part}"

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text of the package thenar_NAME: the classifier in src/, what each ecosystem asks for beside
        it, a self test in check/, and an example for Arduino.

        The example's pins are numbered as on an Uno or a Mega: switches from 2 on without 13, joints from A0 on.
        """
        from thenar.firmware_templates.rendering import render

        from ..probes import CHECKS, check_header
        from ..words import comment, inputs_in_words, markdown

        name, names = library.name, library.names
        counts = {"switches": len(names.switches), "joints": len(names.joints)}
        grasps = [comment(grasp) for grasp in names.grasps]
        values = {
            **{"name": name, "version": _VERSION, "thenar": markdown(names.thenar), "checks": CHECKS},
            **{"grasps": grasps, **counts},
            "sentence": f"Recognises {len(grasps)} grasp types from {inputs_in_words(**counts)} of a glove.",
            "sources": [path for path in library.whole if path.endswith((".c", ".S"))],
            "headers": [f"src/{path}" for path in library.whole if path.endswith(".h")],
            "assembly": any(path.endswith(".S") for path in library.whole),
            "words": _keywords(name, names.segments is not None),
        }
        return {
            **{f"src/{path}": text for path, text in library.whole.items()},
            **{path: render(f"package/{path.rsplit('/', 1)[-1]}.j2", **values) for path in _BESIDE},
            "check/check.c": render("host/check.c.j2", name=name, checks=CHECKS),
            f"check/thenar_{name}_check.h": check_header(name, library.layout, names.grasps),
            "examples/Recognise/Recognise.ino": render("package/Recognise.ino.j2", name=name, **_example(library)),
        }

    def missing(self) -> str | None:
        """Return what is missing of compiler and emulator."""
        return super().missing() if self.like is None else self.like.missing()

    def run(
        self,
        files: Mapping[str, str],
        name: str,
        layout: "Layout",
        frames: "Frames",
        *,
        incremental: bool = False,
        lost: "Lost | None" = None,
    ) -> "Answers":
        """Return the answers to frames (n, F) of a core like its own, as the base says."""
        run = super().run if self.like is None else self.like.run
        return run(files, name, layout, frames, incremental=incremental, lost=lost)


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


def _keywords(name: str, segments: bool) -> list[tuple[str, str]]:
    """Return each word of the library with the kind of keyword that it is to the Arduino editor."""
    kinds = {
        "KEYWORD1": (*_TYPES, *(("segmenter",) if segments else ())),
        "KEYWORD2": (*_FUNCTIONS, *(("segment_start", "segment_push") if segments else ())),
    }
    words = [(f"thenar_{name}", "KEYWORD1")]
    words += [(f"thenar_{name}_{word}", kind) for kind, ours in kinds.items() for word in ours]
    return [*words, *((f"THENAR_{name.upper()}_{word}", "LITERAL1") for word in _CONSTANTS)]


def _example(library: "Library") -> dict[str, object]:
    """Return what the template of the example asks for."""
    from ..words import comment, joint_in_words

    switches = [comment(switch.name) for switch in library.names.switches]
    joints = [comment(joint_in_words(joint)) for joint in library.names.joints]
    pins = [pin for pin in range(_FIRST_PIN, _FIRST_PIN + len(switches) + 1) if pin != _LED][: len(switches)]
    text = f"thenar_{library.name}_grasp(grasp)"
    return {
        "switch_pins": list(zip(pins, switches, strict=True)),
        "joint_pins": [(f"A{number}", what) for number, what in enumerate(joints)],
        "digital_needed": max(pins, default=0) + 1,
        "digital_pins": "NUM_DIGITAL_PINS - NUM_ANALOG_INPUTS" if joints else "NUM_DIGITAL_PINS",
        "text": f"(const __FlashStringHelper *){text}" if library.avr else text,
    }


_M0PLUS, _M4 = _CORTEX_M
# It takes within 3 % what a Cortex-M4 takes.
_M33 = replace(
    _M4,
    part="cortex-m33",
    title="Cortex-M33",
    flags=("-mcpu=cortex-m33", *_M4.flags[1:]),
    machine=Machine("mps2-an505", 4 << 20, 4 << 20, 20_000_000, 9, flash_at=0x10000000, ram_at=0x38000000),
)
# The Xtensa core whose compiler and emulator Debian has: an ESP8266's, without an ESP32's windows of registers.
# Numbers are fitted to what qemu counts, as in `costs`, for 3 to 30 classes and 3 to 27 look-ups: 1 to 47 % above.
_XTENSA = Bare(
    architecture="xtensa",
    prefix="xtensa-lx106-elf-",
    emulator=XTENSA_EMULATOR,
    board="",
    name="xtensa",
    part="lx106",
    title="Xtensa LX106",
    help="",
    compiler=XTENSA_COMPILER,
    size=(("xtensa-lx106-elf-size",), "binutils-xtensa-lx106"),
    flags=("-mlongcalls", "-O2", "-ffreestanding"),
    machine=Machine("sim", 1 << 20, 256 << 10, 40_000_000, 9, flash_at=0x50000000, ram_at=0x3FFC0000, cpu="lx106"),
    core=Core(
        fixed=1,
        a_class=7,
        in_parts=4,
        lookup=0,
        found=4,
        part=0,
        pair=2,
        quad=5,
        replaced_pair=8,
        replaced_quad=22,
        replaced_halves=5,
        product=5,
        compared=6,
    ),
)
_NEXT = "{folder}/README.md says how each ecosystem takes it"
# More only where one asks for it: on most, flash is read through a cache of 1 to 32 KiB, and larger tables miss it.
_MOST = 64 << 10


def _family(name: str, like: Target, what: str, **given: Any) -> Package:
    """Return a package for parts whose core is that of another target, which is simulated."""
    tools = {"compiler": like.compiler, "size": like.size, "flags": like.flags, "next_step": _NEXT}
    return Package(
        name=name, part=name, help=what, like=like, most_flash=_MOST, **{"core": like.core, **tools, **given}
    )


# Flash is that of a family's largest usual part, RAM that of its smallest.
MEMBER = (
    Package(
        name="arduino",
        part="arduino",
        help="a package for Arduino's boards with an AVR, and all others; for the smallest part that holds the build",
        next_step="put it into `libraries` of your sketchbook; {folder}/README.md says what else takes it",
        rank=30,
        own_layout=False,
        any_part=True,
    ),
    _family(
        "esp32",
        _XTENSA,
        "a package for ESP-IDF, Arduino, PlatformIO, Zephyr: ESP32, S2, S3 (Xtensa), C3, C6, H2 (RISC-V)",
        rank=31,
        flash=16 << 20,
        ram=256 << 10,
        kind="xtensa",
    ),
    _family(
        "rp2040",
        _M0PLUS,
        "a package for pico-sdk, Arduino, PlatformIO, Zephyr: Raspberry Pi Pico, Cortex-M0+",
        rank=32,
        flash=16 << 20,
        ram=256 << 10,
    ),
    _family(
        "rp2350",
        _M33,
        "the same: Raspberry Pi Pico 2, Cortex-M33 or RISC-V",
        rank=33,
        flash=16 << 20,
        ram=512 << 10,
    ),
    _family(
        "nrf52",
        _M4,
        "a package for Zephyr (nRF Connect), Arduino, PlatformIO: nRF52832, nRF52840, Cortex-M4F",
        rank=34,
        flash=1 << 20,
        ram=64 << 10,
    ),
    _family(
        "stm32",
        _M4,
        "a package for STM32CubeIDE and any CMSIS project, Zephyr, Arduino, PlatformIO; counted as Cortex-M4",
        rank=35,
        flash=2 << 20,
        ram=20 << 10,
    ),
    _family("generic", _M4, "a package for any other part that has a C99 compiler; counted as Cortex-M4", rank=36),
)
