"""A folder of firmware, written whole or not at all; what the user put there stays.

`SHA256SUMS`, which `sha256sum -c` reads, names what thenar has written. What it does not name, such as the objects of a
compiler, is the user's.
"""

import hashlib
import os
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path

from ...runtime.files import sync_folder, write_atomically
from .errors import FirmwareError

SUMS = "SHA256SUMS"


def write_folder(files: Mapping[str, str], folder: Path, *, overwrite: bool = False) -> Path:
    """Write `files`, path below the folder -> text, as `folder`, with their sums; return the folder, resolved.

    With `overwrite` a folder that thenar wrote before is replaced, and what else is in it is kept. Interrupted, it
    leaves the old folder or the new one. Raises FirmwareError where a folder is not empty and may not be overwritten,
    was not written by thenar, or holds files of ours that were changed since, or others where ours are to stand.
    """
    target = folder.resolve()
    _check_place(target, folder)
    kept = _kept(target, folder, overwrite)
    for path in kept:
        if path in files or path == SUMS or any(made.startswith(f"{path}/") for made in files):
            raise FirmwareError(f"{folder} holds {path}, which thenar has not written: move it, or name another folder")
    staged = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    try:
        _fill(staged, {**files, SUMS: sums(files)})
        for path in kept:
            (staged / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(target / path, staged / path, follow_symlinks=False)
        _exchange(staged, target)
    except BaseException:
        shutil.rmtree(staged, ignore_errors=True)
        raise
    sync_folder(target.parent)
    return target


def sums(files: Mapping[str, str]) -> str:
    """Return what `sha256sum` prints of the files, in the order of their names."""
    return "".join(f"{_digest(text.encode())}  {path}\n" for path, text in sorted(files.items()))


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _check_place(target: Path, folder: Path) -> None:
    if not target.parent.is_dir():
        raise FirmwareError(f"{target.parent} is no folder: make it first, then write {folder}")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise FirmwareError(f"{target.parent} may not be written to: name a folder elsewhere")
    if target.exists() and not target.is_dir():
        raise FirmwareError(f"{folder} is a file: name a folder for the firmware")


def _kept(target: Path, folder: Path, overwrite: bool) -> list[str]:
    """Return the files in the target that are not ours, in order. Raises FirmwareError if ours may not be replaced."""
    there = sorted(str(path.relative_to(target)) for path in target.rglob("*") if path.is_symlink() or path.is_file())
    if not there:
        return []
    if SUMS not in there:
        raise FirmwareError(f"{folder} is not empty and holds no firmware of thenar: name another folder")
    if not overwrite:
        raise FirmwareError(f"{folder} holds firmware already: name another folder, or add --overwrite")
    ours = _read_sums(target / SUMS)
    for path in sorted(ours.keys() & set(there)):
        if _digest((target / path).read_bytes()) != ours[path]:
            raise FirmwareError(f"{folder}/{path} was changed since thenar wrote it: move it, or name another folder")
    return [path for path in there if path not in ours and path != SUMS]


def _read_sums(path: Path) -> dict[str, str]:
    lines = path.read_text(errors="replace").splitlines()
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines) if name}


def _fill(folder: Path, files: Mapping[str, str]) -> None:
    folder.mkdir()
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / path, text.encode())


def _exchange(staged: Path, target: Path) -> None:
    """Put the staged folder in the target's place, with one moment between two renames in which there is neither."""
    aside = target.with_name(f".{target.name}.{secrets.token_hex(4)}.old")
    try:
        if target.exists():
            target.rename(aside)
        staged.rename(target)
    except BaseException:
        if aside.exists() and not target.exists():
            aside.rename(target)
        raise
    shutil.rmtree(aside, ignore_errors=True)
