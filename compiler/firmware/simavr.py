"""The compiled classifier on an AVR in libsimavr: the predictions for all frames, their cycles, and the stack needed.

The programs that run AVR code are linked to libsimavr, which is under the GPL 3, so they are not part of the product:
`verify` and the tests build them from the sources in a checkout of thenar on first use.
"""

import atexit
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

import numpy as np

from . import FirmwareError
from .layout import Layout
from .probes import Frames, Lost, Predictions, check_frames, record_files, with_lost
from .tools import AVR_COMPILER, HOST_COMPILER, STRICT, Tool, call, find, lacking, workshop

_CLOCK_HZ = 16_000_000  # of the simulated time, which is not measured
_MAKE: Tool = (("make",), "make")
_WORDS = 6  # bytes of a prediction after the scores: type, margin, probability


def missing() -> str | None:
    """Return why AVR code cannot be run here, and what to install; None if it can."""
    if gone := lacking(AVR_COMPILER, HOST_COMPILER, _MAKE):
        return gone
    try:
        harness("simavr_classify")
    except FirmwareError as error:
        return str(error)
    return None


def harness(program: str) -> Path:
    """Return the path of the harness's `program`, compiled at most once per process.

    Its sources are in the folder $THENAR_SIMAVR, by default tests/simavr of the checkout that contains this file.
    Raises FirmwareError if they are missing or do not compile.
    """
    return _built(_sources(), program)


def _sources() -> Path:
    named = os.environ.get("THENAR_SIMAVR")
    folder = Path(named) if named else Path(__file__).resolve().parents[2] / "tests" / "simavr"
    if not (folder / "simavr_classify.c").is_file():
        raise FirmwareError(
            f"{folder} has no harness for simavr: set THENAR_SIMAVR to the folder tests/simavr of thenar's sources"
        )
    return folder


@lru_cache
def _shelf(_sources: Path) -> Path:
    """Return a new folder for programs of these sources, which is removed when the process ends."""
    folder = mkdtemp(prefix="thenar-simavr-")
    atexit.register(rmtree, folder, ignore_errors=True)
    return Path(folder)


@lru_cache
def _built(sources: Path, program: str) -> Path:
    built = _shelf(sources) / program
    if gone := lacking(HOST_COMPILER, _MAKE):
        raise FirmwareError(gone)
    try:
        call(["make", "-C", str(sources), f"BUILD={built.parent}", str(built)], sources)
    except FirmwareError as error:
        if "sim_avr.h" in str(error) or "lsimavr" in str(error):
            raise FirmwareError("libsimavr not found; Debian: apt-get install libsimavr-dev") from None
        raise
    return built


def run(
    files: Mapping[str, str],
    name: str,
    layout: Layout,
    frames: Frames,
    part: str,
    flags: Sequence[str],
    *,
    lost: Lost | None = None,
) -> Predictions:
    """Return the predictions of the classifier `name` in `files` (file name -> text, for AVR) for frames (n, F).

    `cost` is the cycles from the first instruction of thenar_classify to the end of its return, without the call;
    `stack` the maximum of all frames, the return address included.

    lost  (n, s + j) inputs that are missing in each frame: cycles and stack are not measured then, and margin
          and probability are returned as well

    Raises FirmwareError if compiler or simulator are missing, the files do not compile without warnings or do not fit,
    or the program returns no predictions.
    """
    check_frames(frames, layout)
    command = [find(AVR_COMPILER), *STRICT, *flags]
    program = harness("simavr_classify")
    main = record_files(name, layout, "avr", lost=lost is not None)
    sent, entry = with_lost(frames, lost), "classify" if lost is None else "predict"
    with workshop({**files, **main}) as folder:
        sources = sorted(path for path in (*files, *main) if path.endswith((".c", ".S")))
        call([*command, *sources, "-o", "classifier.elf"], folder)
        found = _symbols(folder)
        size = 2 * layout.tables.n_classes
        if lost is None:
            given = _symbol(found, "memory", 2 * layout.memory)
            said = given + layout.frame_size  # scores follow the inputs
        else:
            size += _WORDS
            given, said = _symbol(found, "thenar_record", sent.shape[1]), _symbol(found, "thenar_said", size)
        spans = f"{given:#x}:{sent.shape[1]}", f"{said:#x}:{size}"
        places = (hex(_symbol(found, symbol)) for symbol in (f"thenar_{entry}", "_end"))
        printed = call([str(program), part, str(_CLOCK_HZ), "classifier.elf", *places, *spans], folder, sent.tobytes())
    predictions = _answers(printed, len(frames), layout, words=0 if lost is None else _WORDS)
    return predictions if lost is None else replace(predictions, cost=None, unit="", stack=None)


def _symbols(folder: Path) -> dict[str, tuple[int, int]]:
    """Return address and size of the symbols of the compiled program, data from 0x800000 on."""
    lines = call(["avr-nm", "--format=posix", "classifier.elf"], folder).decode().splitlines()
    words = [line.split() for line in lines]
    return {word[0]: (int(word[2], 16), int(word[3], 16) if len(word) > 3 else 0) for word in words}


def _symbol(found: Mapping[str, tuple[int, int]], name: str, size: int | None = None) -> int:
    """Return the address of a symbol of `size` bytes, if given. Raises FirmwareError if it is missing or differs."""
    if name not in found:
        raise FirmwareError(f"the compiled program has no {name}")
    address, held = found[name]
    if size not in (None, held):
        raise FirmwareError(f"{name} has {held} bytes in the compiled program, but {size} in its layout")
    return address


def _answers(printed: bytes, frames: int, layout: Layout, *, words: int) -> Predictions:
    """Return the predictions; `words` is the size of type, margin and probability, 0 where these were not requested."""
    classes = layout.tables.n_classes
    said = [("said", "<u2", (words // 2,))] if words else []
    counted = [("grasp", "<u2"), ("cycles", "<u4"), ("stack", "<u2")]
    record = np.dtype([("scores", "<i2", (classes,)), *said, *counted])
    if len(printed) != frames * record.itemsize:
        raise FirmwareError(f"the simulator gave {len(printed)} bytes for {frames} frames of {record.itemsize} bytes")
    records = np.frombuffer(printed, record)
    stack = int(records["stack"].max()) if frames else None
    return Predictions(
        records["scores"].astype(np.int16),
        records["grasp"].astype(np.uint16),
        margins=records["said"][:, 1].astype(np.uint16) if words else None,
        shares=records["said"][:, 2].astype(np.uint16) if words else None,
        cost=records["cycles"].astype(np.uint32),
        unit="cycles",
        stack=stack,
    )
