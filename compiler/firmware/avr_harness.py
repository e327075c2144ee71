"""The programs that run AVR code in libsimavr: found in a checkout of thenar, compiled when they are first needed.

They are linked to libsimavr, which is under the GPL 3, and so are no part of the product: `verify` and the tests build
them from the sources that stand with the tests.
"""

import atexit
import os
from functools import lru_cache
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

from .errors import FirmwareError
from .tools import HOST_COMPILER, Tool, call, lacking

AVR_COMPILER: Tool = (("avr-gcc",), "gcc-avr avr-libc")
_MAKE: Tool = (("make",), "make")


def missing() -> str | None:
    """Return what keeps AVR code from being run here, and what to install; None if nothing does."""
    if gone := lacking(AVR_COMPILER, HOST_COMPILER, _MAKE):
        return gone
    try:
        harness("simavr_classify")
    except FirmwareError as error:
        return str(error)
    return None


def harness(program: str) -> Path:
    """Return the path of the harness's `program`, compiled at most once a process.

    Its sources stand in the folder $THENAR_SIMAVR, else in tests/simavr of the checkout that this file belongs to.
    Raises FirmwareError if they are not there or do not compile.
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
