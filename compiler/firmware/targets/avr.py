"""AVRs: the parts of Arduino's Uno and Mega, whose code runs in libsimavr: it counts cycles, and the stack needed.

The programs that run AVR code are linked to libsimavr, which is under the GPL 3, so they are not part of the product:
`verify` and the tests build them from the sources in a checkout of thenar on first use.
"""

import atexit
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, ClassVar

from thenar.firmware_templates.rendering import render

from .. import FirmwareError
from ..tools import AVR_COMPILER, HOST_COMPILER, STRICT, Tool, call, compile_objects, find, lacking, workshop
from .base import Formula, Target

if TYPE_CHECKING:
    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Frames, Lost, Predictions

_MAKE: Tool = (("make",), "make")
_WORDS = 6  # bytes of a prediction after the scores: type, margin, probability


@dataclass(frozen=True, kw_only=True)
class Avr(Target):
    """An AVR; programmer is the boot loader of its usual boards, in avrdude."""

    avr: ClassVar[bool] = True

    programmer: str

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text: the library, a Makefile (program, size, flash) and an initial main()."""
        values = {"name": library.name, "target": self, "sources": library.sources, "tables": library.layout.tables}
        made = {path: render(f"avr_library/{path}.j2", **values) for path in ("Makefile", "main.c")}
        return library.whole | made

    def missing(self) -> str | None:
        """Return which of avr-gcc and simavr is missing, and how to install it; None if neither is."""
        if gone := lacking(AVR_COMPILER, HOST_COMPILER, _MAKE):
            return gone
        try:
            harness("simavr_classify")
        except FirmwareError as error:
            return str(error)
        return None

    def run(
        self, files: Mapping[str, str], name: str, layout: "Layout", frames: "Frames", *, lost: "Lost | None" = None
    ) -> "Predictions":
        """Return the predictions for frames (n, F) in simavr, as in the base class.

        Their cost is the cycles from the first instruction of thenar_classify to the end of its return, without the
        call; their stack the maximum of all frames, the return address included. With `lost` both are not measured,
        and margin and probability are returned as well.
        """
        from ..probes import record_files, sent_frames

        sent = sent_frames(frames, lost, layout)
        command = [find(AVR_COMPILER), *self.flags]
        program = harness("simavr_classify")
        main = record_files(name, layout, "avr", lost=lost is not None)
        entry = "classify" if lost is None else "predict"
        with workshop({**files, **main}) as folder:
            sources = sorted(path for path in (*files, *main) if path.endswith((".c", ".S")))
            objects = compile_objects([*command, *STRICT], sources, folder)
            call([*command, *objects, "-o", "classifier.elf"], folder)
            words = map(str.split, call(["avr-nm", "--format=posix", "classifier.elf"], folder).decode().splitlines())
            # Address and size of the program's symbols, data from 0x800000 on.
            found = {word[0]: (int(word[2], 16), int(word[3], 16) if len(word) > 3 else 0) for word in words}
            size = 2 * layout.tables.n_classes
            if lost is None:
                given = _symbol(found, "memory", 2 * layout.memory)
                said = given + layout.frame_size  # scores follow the inputs
            else:
                size += _WORDS
                given, said = _symbol(found, "thenar_record", sent.shape[1]), _symbol(found, "thenar_said", size)
            spans = f"{given:#x}:{sent.shape[1]}", f"{said:#x}:{size}"
            places = (hex(_symbol(found, symbol)) for symbol in (f"thenar_{entry}", "_end"))
            printed = call(
                [str(program), self.part, str(self.clock_hz), "classifier.elf", *places, *spans], folder, sent.tobytes()
            )
        return _answers(printed, len(frames), layout, lost=lost is not None)


def harness(program: str) -> Path:
    """Return the path of the harness's `program`, compiled at most once per process.

    Its sources are in the folder $THENAR_SIMAVR, by default tests/simavr of the checkout that contains this file.
    Raises FirmwareError if they are missing or do not compile.
    """
    named = os.environ.get("THENAR_SIMAVR")
    folder = Path(named) if named else Path(__file__).resolve().parents[3] / "tests" / "simavr"
    if not (folder / "simavr_classify.c").is_file():
        raise FirmwareError(
            f"{folder} has no harness for simavr: set THENAR_SIMAVR to the folder tests/simavr of thenar's sources"
        )
    return _built(folder, program)


@lru_cache
def _built(sources: Path, program: str) -> Path:
    if gone := lacking(HOST_COMPILER, _MAKE):
        raise FirmwareError(gone)
    folder = mkdtemp(prefix="thenar-simavr-")
    atexit.register(rmtree, folder, ignore_errors=True)
    built = Path(folder, program)
    try:
        call(["make", "-C", str(sources), f"BUILD={built.parent}", str(built)], sources)
    except FirmwareError as error:
        if "sim_avr.h" in str(error) or "lsimavr" in str(error):
            raise FirmwareError("libsimavr not found; Debian: apt-get install libsimavr-dev") from None
        raise
    return built


def _symbol(found: Mapping[str, tuple[int, int]], name: str, size: int | None = None) -> int:
    """Return the address of a symbol of `size` bytes, if given. Raises FirmwareError if it is missing or differs."""
    if name not in found:
        raise FirmwareError(f"the compiled program has no {name}")
    address, held = found[name]
    if size not in (None, held):
        raise FirmwareError(f"{name} has {held} bytes in the compiled program, but {size} in its layout")
    return address


def _answers(printed: bytes, frames: int, layout: "Layout", *, lost: bool) -> "Predictions":
    """Return the predictions: with type, margin and probability where inputs may be `lost`, else with their costs."""
    import numpy as np

    from ..probes import Predictions

    said = [("said", "<u2", (_WORDS // 2,))] if lost else []
    counted = [("grasp", "<u2"), ("cycles", "<u4"), ("stack", "<u2")]
    record = np.dtype([("scores", "<i2", (layout.tables.n_classes,)), *said, *counted])
    if len(printed) != frames * record.itemsize:
        raise FirmwareError(f"the simulator gave {len(printed)} bytes for {frames} frames of {record.itemsize} bytes")
    records = np.frombuffer(printed, record)
    scores, grasps = records["scores"].astype(np.int16), records["grasp"].astype(np.uint16)
    if lost:
        _, margins, shares = records["said"].astype(np.uint16).T
        return Predictions(scores, grasps, margins, shares)
    stack = int(records["stack"].max()) if frames else None
    return Predictions(scores, grasps, cost=records["cycles"].astype(np.uint32), unit="cycles", stack=stack)


# `lpm` reaches the first 64 KiB of the flash, which the tables share with all other constants. The clocks are those of
# Arduino's boards.
_avr = partial(
    Avr,
    help="a library with a Makefile",
    next_step="`make -C {folder}` compiles it",
    carried=True,
    most_flash=48 << 10,
    clock_hz=16_000_000,
    kind="avr",
    compiler=AVR_COMPILER,
    formula=Formula(
        (279.9, 195.8, 73.24, 34.62, 95.51, 102.7, 81.31, 7.858, 129.9, 29.44, 14.06, 80.66, 0.9945), 2268, 62
    ),
)

MEMBER = (
    _avr(
        name="avr328p",
        part="atmega328p",
        rank=10,
        flags=("-mmcu=atmega328p", "-Os"),
        flash=32 << 10,
        ram=2 << 10,
        programmer="arduino",
    ),
    _avr(
        name="avr2560",
        part="atmega2560",
        rank=11,
        flags=("-mmcu=atmega2560", "-Os"),
        flash=256 << 10,
        ram=8 << 10,
        programmer="wiring",
    ),
)
