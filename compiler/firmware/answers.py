"""What a compiled classifier answers, and the bytes in which frames go in and answers come out."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thenar.firmware_templates.rendering import render

from .costs import Unit
from .errors import FirmwareError
from .layout import Layout

Frames = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """The answers to n frames: scores (n, K) int16, classes (n,) the first best of them.

    cost   what each answer took, (n,) in `unit`; None where nothing was counted (unit "")
    stack  bytes of stack that an answer needs; None where it was not measured
    names  of the K types, as the program gave them; None where it was not asked
    """

    scores: NDArray[np.int16]
    classes: NDArray[np.uint16]
    cost: NDArray[np.uint32] | None = None
    unit: Unit = ""
    stack: int | None = None
    names: tuple[str, ...] | None = None

    @property
    def most(self) -> int:
        """What the slowest answer took, where it was counted."""
        return 0 if self.cost is None else int(self.cost.max())


def check_frames(frames: Frames, layout: Layout) -> None:
    """Raise FirmwareError unless `frames` is uint8 (n, F)."""
    size = layout.frame_size
    if frames.dtype != np.uint8 or frames.ndim != 2 or frames.shape[1] != size:
        raise FirmwareError(f"frames are {frames.dtype} {frames.shape}, this layout takes uint8 (n, {size})")


def names_in(printed: bytes, layout: Layout) -> tuple[tuple[str, ...], bytes]:
    """Return the names of the K types that a program printed first, each with a zero behind it, and the rest.

    Raises FirmwareError if there are fewer.
    """
    *names, rest = printed.split(b"\0", len(layout.start))
    if len(names) < len(layout.start):
        raise FirmwareError(f"the program printed {len(names)} names for {len(layout.start)} grasp types")
    return tuple(name.decode(errors="replace") for name in names), rest


def answers_from(printed: bytes, frames: Frames, layout: Layout) -> Answers:
    """Return the answers that a program printed: for each frame K scores and a class, 16 bits each, little-endian.

    Raises FirmwareError unless there is one for every frame.
    """
    size = len(layout.start) + 1
    if len(printed) != 2 * size * len(frames):
        raise FirmwareError(f"the program printed {len(printed)} bytes for {len(frames)} frames of {2 * size} bytes")
    words = np.frombuffer(printed, "<u2").astype(np.uint16).reshape(len(frames), size)
    return Answers(words[:, :-1].view(np.int16), words[:, -1])


def record_files(
    name: str, layout: Layout, machine: Literal["host", "cortex"], answer: Literal["classify", "update"]
) -> dict[str, str]:
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
        frame_bytes=layout.frame_size,
    )
    return {"record.h": record, "main.c": render(f"checking/{machine}_main.c.j2", name=name, answer=answer)}
