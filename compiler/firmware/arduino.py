"""The classifier as an Arduino library, for arduino-cli and PlatformIO: all but the classifier's own files, its `src/`.

Layout and fields are those of the Arduino library specification, revision 1.5.
"""

from thenar.firmware_templates.rendering import render
from thenar.runtime.manifest import Manifest

from .layout import Layout
from .words import comment, inputs_in_words, markdown

_VERSION = "1.0.0"
_LED = 13  # has the board's LED and its resistor to ground, which outdo a pull-up on some boards
_FIRST_PIN = 2  # 0 and 1 are the serial port's

_TYPES = ("frame", "class", "switch", "code")
_FUNCTIONS = ("set_switch", "classify", "update", "grasp")
_VARIABLES = ("input", "scores")
_CONSTANTS = ("CLASSES", "SWITCHES", "GROUPS", "JOINTS")


def arduino_files(name: str, manifest: Manifest, layout: Layout, *, avr: bool) -> dict[str, str]:
    """Return path -> text of the library thenar_NAME around `classifier_files(..., avr=avr)`, which belong in src/.

    With `avr` the library is for boards with an AVR only, else for all. The example's pins are numbered as on an Uno or
    a Mega: switches from 2 on without 13, joints from A0 on.
    """
    counts = {"switches": layout.tables.n_switches, "joints": layout.tables.n_joints}
    inputs = inputs_in_words(**counts)
    grasps = [comment(grasp) for grasp in manifest.grasps]
    architectures = "avr" if avr else "*"
    properties = {"version": _VERSION, "classes": len(grasps), "architectures": architectures, "inputs": inputs}
    readme = {"thenar": markdown(manifest.thenar), "grasps": grasps, "inputs": inputs, **counts}
    return {
        "library.properties": render("arduino/library.properties.j2", name=name, **properties),
        "keywords.txt": render("arduino/keywords.txt.j2", words=_keywords(name)),
        "README.md": render("arduino/README.md.j2", name=name, **readme),
        "examples/Recognise/Recognise.ino": _example(name, manifest, layout, avr),
    }


def _keywords(name: str) -> list[tuple[str, str]]:
    """Return each word of the library with the kind of keyword that it is to the Arduino editor."""
    kinds = {"KEYWORD1": _TYPES, "KEYWORD2": (*_FUNCTIONS, *_VARIABLES)}
    words = [(f"thenar_{name}_{word}", kind) for kind, ours in kinds.items() for word in ours]
    return [*words, *((f"THENAR_{name.upper()}_{word}", "LITERAL1") for word in _CONSTANTS)]


def _example(name: str, manifest: Manifest, layout: Layout, avr: bool) -> str:
    switches = [comment(switch.name) for switch in manifest.switches]
    joints = [comment(joint.name) for joint in manifest.joints]
    pins = [pin for pin in range(_FIRST_PIN, _FIRST_PIN + len(switches) + 1) if pin != _LED][: len(switches)]
    text = f"thenar_{name}_grasp(grasp)"
    reading = "analogRead(joint_pins[i])"
    return render(
        "arduino/Recognise.ino.j2",
        name=name,
        switch_pins=list(zip(pins, switches, strict=True)),
        joint_pins=[(f"A{number}", what) for number, what in enumerate(joints)],
        digital_needed=max(pins, default=0) + 1,
        digital_pins="NUM_DIGITAL_PINS - NUM_ANALOG_INPUTS" if joints else "NUM_DIGITAL_PINS",
        code=f"(uint8_t)({reading} >> 2)" if layout.code_bits == 8 else f"(uint16_t){reading}",
        text=f"(const __FlashStringHelper *){text}" if avr else text,
    )
