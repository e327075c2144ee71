"""The firmware that a build carries: made when it is compiled, held against what would be made today."""

from pathlib import Path

from msgspec import Struct

from thenar.runtime.build import Build
from thenar.runtime.files import read_file
from thenar.runtime.manifest import Manifest
from thenar.runtime.tables import IntegerTables

from ..firmware.choose import smallest_fit
from ..firmware.classifier import LIBRARY_NAME, Library
from ..firmware.errors import FirmwareError
from ..firmware.folder import LARGEST

FIRMWARE_NAME = "firmware"
LIBRARY_FILES = tuple(f"thenar_{LIBRARY_NAME}{ending}" for ending in (".h", ".c", "_avr.S"))


class Carried(Struct, frozen=True):
    """Whether a build has the folder `firmware/`, and which of its files are not what thenar makes of the build now."""

    present: bool
    outdated: tuple[str, ...]


def made_firmware(manifest: Manifest, tables: IntegerTables) -> tuple[dict[str, str], str]:
    """Return path in the build -> text of its firmware, and a sentence that says what for, or why there is none."""
    try:
        fit = smallest_fit(tables)
        made = Library(LIBRARY_NAME, manifest, fit.choice.layout, fit.target.avr, fit.notes()).files
    except FirmwareError as reason:
        return {}, f"no firmware: {reason}"
    return {f"{FIRMWARE_NAME}/{name}": text for name, text in made.items()}, f"firmware {fit.words}"


def carried_firmware(folder: Path, build: Build) -> Carried:
    """Return how the firmware in the build `folder` stands."""
    if not (folder / FIRMWARE_NAME).is_dir():
        return Carried(False, ())
    made, _ = made_firmware(build.manifest, build.tables)
    now = {name: text.encode() for name, text in made.items()}
    names = [f"{FIRMWARE_NAME}/{name}" for name in LIBRARY_FILES]
    return Carried(True, tuple(name for name in names if now.get(name) != _content(folder / name)))


def _content(path: Path) -> bytes | None:
    try:
        return read_file(path, LARGEST, FirmwareError)
    except (OSError, FirmwareError):
        return None
