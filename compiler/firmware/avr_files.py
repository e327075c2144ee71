"""The folder of a classifier for an AVR, but for the classifier itself."""

from thenar.firmware_templates.rendering import render

from .layout import Layout
from .microcontrollers import PARTS
from .targets import Target


def avr_files(name: str, layout: Layout, target: Target) -> dict[str, str]:
    """Return path -> text: Makefile (program, size, flash) and a main() to start from."""
    n_classes = len(layout.start)
    values = {"name": name, "part": target.part, "programmer": PARTS[target.part].programmer}
    class_type = "uint8_t" if n_classes <= 255 else "uint16_t"
    return {
        "Makefile": render("avr_library/Makefile.j2", **values),
        "main.c": render("avr_library/main.c.j2", name=name, joints=len(layout.joints), class_type=class_type),
    }
