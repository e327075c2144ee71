"""A folder of firmware, written whole or not at all; what the user put there stays.

`SHA256SUMS`, which `sha256sum -c` reads, names what thenar has written. What it does not name, such as the objects of a
compiler, is the user's.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from thenar.runtime.files import read_file

from ..publication import check_folder, entries, publish_folder
from .errors import FirmwareError

SUMS = "SHA256SUMS"
# Bytes of one text; the tables of the largest build have fewer.
LARGEST = 64 << 20


def write_folder(files: Mapping[str, str], folder: Path, *, overwrite: bool = False) -> Path:
    """Write `files`, path below the folder -> text, as `folder`, with their sums; return the folder, resolved.

    With `overwrite` a folder that thenar wrote before is replaced, and what else is in it is kept. Killed, it leaves
    the old folder or the new one. Raises FirmwareError where a folder is not empty and may not be overwritten, was not
    written by thenar, or holds files of ours that were changed since, or others where ours are to be written.
    """
    target, _ = check_folder(folder, _users_files, FirmwareError)
    if not overwrite and target.exists() and any(target.iterdir()):
        raise FirmwareError(f"{folder} holds firmware already: name another folder, or add --overwrite")
    content = {path: text.encode() for path, text in {**files, SUMS: sums(files)}.items()}
    return publish_folder(content, folder, _users_files, FirmwareError)


def sums(files: Mapping[str, str]) -> str:
    """Return what `sha256sum` prints of the files, in the order of their names."""
    return "".join(f"{_digest(text.encode())}  {path}\n" for path, text in sorted(files.items()))


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _users_files(folder: Path) -> list[str]:
    """Return the user's entries of the folder, in order. Raises FirmwareError if ours may not be replaced."""
    there = entries(folder)
    if not there:
        return []
    if SUMS not in there:
        raise FirmwareError(f"{folder} is not empty and holds no firmware of thenar: name another folder")
    ours = _read_sums(folder / SUMS)
    for path in sorted(ours.keys() & set(there)):
        if _digest(read_file(folder / path, LARGEST, FirmwareError)) != ours[path]:
            raise FirmwareError(f"{folder}/{path} was changed since thenar wrote it: move it, or name another folder")
    return [path for path in there if path not in ours and path != SUMS]


def _read_sums(path: Path) -> dict[str, str]:
    lines = read_file(path, LARGEST, FirmwareError).decode(errors="replace").splitlines()
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines) if name}
