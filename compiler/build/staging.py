"""A build folder is published whole: written beside its place, made durable, then renamed into it."""

import os
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path

from ...runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, SCAN_NAME, TABLES_NAME
from ...runtime.files import sync_folder, write_atomically
from ..firmware.library_names import FIRMWARE_NAME, LIBRARY_FILES
from ..spec.files import NAMES
from .errors import CompileError
from .made import REPORT_NAME, SPEC_FOLDER

# A build that was compiled for no harness has no scan map, one that is too large for any microcontroller no firmware,
# one without a report no spec.
MEMBERS = frozenset({MANIFEST_NAME, TABLES_NAME, ENSEMBLE_NAME, SCAN_NAME, REPORT_NAME})
_FOLDERS = {FIRMWARE_NAME: frozenset(LIBRARY_FILES), SPEC_FOLDER: NAMES}


def check_target(folder: Path) -> Path:
    """Return `folder` resolved, if a build may be put there: a new or empty folder, or one that holds only a build.

    Raises CompileError otherwise: files that thenar has not made are never deleted.
    """
    target = folder.resolve()
    if not target.parent.is_dir():
        raise CompileError(f"{target.parent} is no folder: make it first, then compile into {folder}")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise CompileError(f"{target.parent} may not be written to: name a folder elsewhere")
    if target.exists() and not target.is_dir():
        raise CompileError(f"{folder} is a file: name a folder for the build")
    if target.exists() and any(target.iterdir()) and not (target / MANIFEST_NAME).exists():
        raise CompileError(f"{folder} is not empty and not a build: name another folder, or empty this one")
    for place in (target, _aside(target)):
        _refuse_foreign(place)
    return target


def _refuse_foreign(folder: Path) -> None:
    places = {folder / name: names for name, names in _FOLDERS.items()}
    inner = {place: names for place, names in places.items() if place.is_dir() and not place.is_symlink()}
    foreign = [path for path in _foreign(folder, MEMBERS) if path not in inner]
    foreign += [path for place, names in inner.items() for path in _foreign(place, names)]
    if foreign:
        name = foreign[0].relative_to(folder)
        raise CompileError(f"{folder} holds {name}, which is not of a build: move it, or name another folder")


def _foreign(folder: Path, members: frozenset[str]) -> list[Path]:
    """Return what is in `folder`, if there is one, that is not a file by the name of a member."""
    there = sorted(folder.iterdir()) if folder.exists() else []
    return [path for path in there if path.name not in members or not path.is_file()]


def publish(files: Mapping[str, bytes], target: Path) -> None:
    """Write `files`, path below the folder -> content, as `target`, in place of what `check_target` allows there.

    Interrupted, it leaves the old build or the new one, whole, and nothing else; after a crash in the moment between
    two renames the old build is in `.NAME.old` beside the place of the new one. Raises CompileError as `check_target`
    does.
    """
    # Not named after the process: in a container the next one may have the same number, and meet what a crash left.
    staged = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    try:
        staged.mkdir()
        for name, data in files.items():
            (staged / name).parent.mkdir(exist_ok=True)
            write_atomically(staged / name, data)
        # Again, because training takes its time and the folder is the user's.
        _exchange(staged, check_target(target))
    except BaseException:
        shutil.rmtree(staged, ignore_errors=True)
        raise
    sync_folder(target.parent)


def _aside(target: Path) -> Path:
    return target.with_name(f".{target.name}.old")


def _exchange(staged: Path, target: Path) -> None:
    aside = _aside(target)
    try:
        if target.exists():
            _discard(aside)
            target.rename(aside)
        staged.rename(target)
        _discard(aside)
    except BaseException:
        if target.exists():
            _discard(aside)
        elif aside.exists():
            aside.rename(target)
        raise


def _discard(build: Path) -> None:
    """Delete a build, and nothing that is not of one: a folder that holds more stays, as an OSError."""
    if build.exists():
        for name, members in _FOLDERS.items():
            if (inner := build / name).exists():
                _discard_files(inner, members)
        _discard_files(build, MEMBERS)


def _discard_files(folder: Path, names: frozenset[str]) -> None:
    for name in names:
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()
