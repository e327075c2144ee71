"""The classifier as an Arduino library, for arduino-cli and PlatformIO: all but the classifier's own files, its `src/`.

Layout and fields are those of the Arduino library specification, revision 1.5.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .base import Target

if TYPE_CHECKING:
    from ..classifier import Library

_VERSION = "1.0.0"
_LED = 13  # has the board's LED and its resistor to ground, which outdo a pull-up on some boards
_FIRST_PIN = 2  # 0 and 1 are the serial port's

_TYPES = ("frame", "class", "switch", "code")
_FUNCTIONS = ("set_switch", "classify", "update", "grasp")
_VARIABLES = ("input", "scores")
_CONSTANTS = ("CLASSES", "SWITCHES", "PORTS", "JOINTS")


@dataclass(frozen=True, kw_only=True)
class Arduino(Target):
    """A library for Arduino boards: those with an AVR where the layout is one's, else all."""

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text of the library thenar_NAME, with the classifier in src/ and an example.

        The example's pins are numbered as on an Uno or a Mega: switches from 2 on without 13, joints from A0 on.
        """
        from thenar.firmware_templates.rendering import render

        from ..words import comment, inputs_in_words, markdown

        name, names = library.name, library.names
        counts = {"switches": len(names.switches), "joints": len(names.joints)}
        inputs, grasps = inputs_in_words(**counts), [comment(grasp) for grasp in names.grasps]
        architectures = "avr" if library.avr else "*"
        properties = {"version": _VERSION, "classes": len(grasps), "architectures": architectures, "inputs": inputs}
        readme = {"thenar": markdown(names.thenar), "grasps": grasps, "inputs": inputs, **counts}
        return {
            **{f"src/{path}": text for path, text in library.whole.items()},
            "library.properties": render("arduino/library.properties.j2", name=name, **properties),
            "keywords.txt": render("arduino/keywords.txt.j2", words=_keywords(name, names.segments is not None)),
            "README.md": render("arduino/README.md.j2", name=name, **readme),
            "examples/Recognise/Recognise.ino": render("arduino/Recognise.ino.j2", name=name, **_example(library)),
        }


def _keywords(name: str, segments: bool) -> list[tuple[str, str]]:
    """Return each word of the library with the kind of keyword that it is to the Arduino editor."""
    kinds = {
        "KEYWORD1": (*_TYPES, *(("segmenter",) if segments else ())),
        "KEYWORD2": (*_FUNCTIONS, *_VARIABLES, *(("segment_start", "segment_push") if segments else ())),
    }
    words = [(f"thenar_{name}_{word}", kind) for kind, ours in kinds.items() for word in ours]
    return [*words, *((f"THENAR_{name.upper()}_{word}", "LITERAL1") for word in _CONSTANTS)]


def _example(library: "Library") -> dict[str, object]:
    """Return what the template of the example asks for."""
    from ..words import comment

    switches = [comment(switch.name) for switch in library.names.switches]
    joints = [comment(joint.name) for joint in library.names.joints]
    pins = [pin for pin in range(_FIRST_PIN, _FIRST_PIN + len(switches) + 1) if pin != _LED][: len(switches)]
    text = f"thenar_{library.name}_grasp(grasp)"
    reading = "analogRead(joint_pins[i])"
    return {
        "switch_pins": list(zip(pins, switches, strict=True)),
        "joint_pins": [(f"A{number}", what) for number, what in enumerate(joints)],
        "digital_needed": max(pins, default=0) + 1,
        "digital_pins": "NUM_DIGITAL_PINS - NUM_ANALOG_INPUTS" if joints else "NUM_DIGITAL_PINS",
        "code": f"(uint8_t)({reading} >> 2)" if library.layout.code_bits == 8 else f"(uint16_t){reading}",
        "text": f"(const __FlashStringHelper *){text}" if library.avr else text,
    }


MEMBER = Arduino(
    name="arduino",
    part="arduino",
    help="an Arduino library with an example",
    next_step="put it into `libraries` of your sketchbook, or into `lib` of a PlatformIO project",
    rank=30,
    own_layout=False,
    any_part=True,
)
