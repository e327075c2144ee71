"""The cost of a classifier on an AVR, from the raw bytes of a frame to the grasp: compiled, linked, and run frame by
frame in libsimavr.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.simavr import harness
from thenar.compiler.firmware.targets import Target
from thenar.compiler.firmware.tools import AVR_COMPILER, call, find, workshop
from thenar.compiler.firmware.words import numbered

# Flags of thenar's Makefiles: functions that are not called are not linked.
_HOW = ("-Os", "-w", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")
Frames = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Cost:
    """The cost of a classifier on `part`: cycles per frame, median and maximum; bytes of flash, RAM and stack.

    differing  how many of `rows` predictions differ from those in Python
    """

    part: str
    cycles: int
    most: int
    flash: int
    ram: int
    stack: int
    differing: int
    rows: int

    @property
    def cells(self) -> tuple[str, ...]:
        """The columns of the table that every classifier has."""
        return (
            f"{self.cycles:,} ({self.most:,})",
            f"{self.flash:,}",
            f"{self.ram} + {self.stack}",
            f"{self.differing} of {self.rows}",
        )


def _linked(folder: Path, sources: Mapping[str, str], part: str, include: Sequence[str] = ()) -> tuple[int, int]:
    """Link `program.elf` from the sources in the folder; return bytes of flash and RAM. Ignores warnings of peers."""
    code = sorted(path for path in sources if path.endswith((".c", ".cpp", ".S")))
    paths = [f"-I{path}" for path in include]
    call([find(AVR_COMPILER), f"-mmcu={part}", *_HOW, *paths, *code, "-lm", "-o", "program.elf"], folder)
    text, data, bss = call(["avr-size", "program.elf"], folder).decode().splitlines()[1].split()[:3]
    return int(text) + int(data), int(data) + int(bss)


def of_ours(layout: Layout, target: Target, frames: Frames, expected: NDArray[np.integer]) -> Cost:
    """Return the cost of thenar's classifier for frames with known scores (n, K).

    The bytes of a frame are written directly into its inputs: nothing has to be copied.
    """
    files = Library("glove", numbered(layout.tables), layout).files
    body = "thenar_init(&hand, &thenar_glove_model, memory); for (;;) thenar_classify(&hand);"
    state = "uint16_t memory[THENAR_GLOVE_MEMORY];\nthenar hand;\n"
    program = {**files, "main.c": f'#include "thenar_glove.h"\n{state}int main(void) {{ {body} }}\n'}
    with workshop(program) as folder:
        flash, ram = _linked(folder, program, target.part)
    results = target.run(files, "glove", layout, frames)
    assert results.cost is not None
    assert results.stack is not None
    wrong = (results.scores != expected).any(axis=1) | (results.classes != expected.argmax(axis=1))
    middle, most, differing = int(np.median(results.cost)), results.most, int(np.count_nonzero(wrong))
    return Cost(target.part, middle, most, flash, ram, results.stack, differing, len(frames))


def of_peer(
    name: str,
    files: Mapping[str, str],
    frames: Frames,
    expected: NDArray[np.intp],
    target: Target,
    include: Sequence[str] = (),
) -> Cost:
    """Return the cost of a peer's classifier for raw frames, including feature extraction.

    `expected` are its predictions in Python. Raises FirmwareError if it does not fit.
    """
    program = {**files, "main.c": "int predict(void);\nint main(void) { for (;;) predict(); }\n"}
    with workshop(program) as folder:
        flash, ram = _linked(folder, program, target.part, include)
        if flash > target.flash or ram > target.ram:
            raise FirmwareError(f"{name} takes {flash} bytes of flash and {ram} of RAM: not on an {target.part}")
        words = [line.split() for line in call(["avr-nm", "-P", "program.elf"], folder).decode().splitlines()]
        at = {word[0]: f"0x{word[2]}" for word in words if len(word) > 2}
        places = [at["predict"], at["_end"], f"{at['input']}:{frames.shape[1]}", f"{at['input']}:1"]
        command = [str(harness("simavr_classify")), target.part, str(target.clock_hz), "program.elf", *places]
        known = call(command, folder, frames.tobytes())
    record = np.dtype([("echo", "u1"), ("grasp", "<u2"), ("cycles", "<u4"), ("stack", "<u2")])
    found = np.frombuffer(known, record)
    differing = int(np.count_nonzero(found["grasp"] != expected))
    middle, most, stack = int(np.median(found["cycles"])), int(found["cycles"].max()), int(found["stack"].max())
    return Cost(target.part, middle, most, flash, ram, stack, differing, len(found))
