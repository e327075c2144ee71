"""The program around a classifier under test: frames from bytes, answers as bytes."""

from typing import Literal

from thenar.firmware_templates.rendering import render

from .answers import frame_size
from .layout import Layout

Machine = Literal["host", "cortex"]


def record_files(name: str, layout: Layout, machine: Machine, answer: Literal["classify", "update"]) -> dict[str, str]:
    """Return the files, name -> text, of the program that answers frames with the function `answer` of `name`.

    For classify() it writes the groups' bytes into the input; for update() it calls set_switch() for every switch.
    """
    record = render(
        "checking/record.h.j2",
        name=name,
        classes=len(layout.start),
        sizes=[len(numbers) for numbers in layout.groups],
        by_switch=answer == "update",
        padding=layout.padding,
        joints=len(layout.joints),
        code_bytes=layout.code_bits // 8,
        frame_bytes=frame_size(layout),
    )
    return {"record.h": record, "main.c": render(f"checking/{machine}_main.c.j2", name=name, answer=answer)}
