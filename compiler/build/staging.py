"""A build folder is published whole: written beside its place, made durable, then renamed into it."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from ...runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, TABLES_NAME
from ...runtime.files import sync_folder, write_atomically
from .errors import CompileError

MEMBERS = frozenset({MANIFEST_NAME, TABLES_NAME, ENSEMBLE_NAME})


def check_target(folder: Path) -> Path:
    """Return `folder` resolved, if a build may be put there: a new or empty folder, or one that holds only a build.

    Raises CompileError otherwise: files that thenar has not made are never deleted.
    """
    target = folder.resolve()
    if not target.parent.is_dir():
        raise CompileError(f"{target.parent} is no folder: make it first, then compile into {folder}")
    if not target.exists():
        return target
    if not target.is_dir():
        raise CompileError(f"{folder} is a file: name a folder for the build")
    names = {path.name for path in target.iterdir()}
    if names and MANIFEST_NAME not in names:
        raise CompileError(f"{folder} is not empty and not a build: name another folder, or empty this one")
    if foreign := sorted(names - MEMBERS):
        raise CompileError(f"{folder} holds {foreign[0]}, which is not of a build: move it, or name another folder")
    return target


def publish(files: Mapping[str, bytes], target: Path) -> None:
    """Write `files` as the folder `target`, in place of what `check_target` allowed there.

    Interrupted, it leaves the old build and nothing else; after a crash in the moment between two renames the old build
    is in `.NAME.old` beside the place of the new one.
    """
    staged = target.with_name(f".{target.name}.{os.getpid()}.part")
    staged.mkdir()
    try:
        for name, data in files.items():
            write_atomically(staged / name, data)
        _exchange(staged, target)
    except BaseException:
        shutil.rmtree(staged, ignore_errors=True)
        raise
    sync_folder(target.parent)


def _exchange(staged: Path, target: Path) -> None:
    aside = target.with_name(f".{target.name}.old")
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
        for name in MEMBERS:
            (build / name).unlink(missing_ok=True)
        build.rmdir()
