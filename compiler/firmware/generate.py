"""The files of a firmware folder, from tables and a target; the folder is written atomically.

`SHA256SUMS`, which `sha256sum -c` reads, lists the files that thenar has written. Other files, such as a compiler's
objects, belong to the user and are kept.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from thenar.runtime.files import read_file
from thenar.runtime.model.integers import IntegerTables

from ..publication import check_folder, entries, publish_folder
from . import FirmwareError
from .classifier import LIBRARY_NAME, Library
from .costs import PartFit, fit_for
from .sensors import Sensors
from .targets import TARGETS, Target
from .words import Names, check_name


@dataclass(frozen=True, eq=False)
class Firmware:
    """The library that classifies frames by `tables`, for `target`, one of TARGETS.

    names        the names of grasp types, switches and joints: a build's manifest, or words.numbered(tables)
    name         of its files and functions: lower-case letters, digits and _, at most 32
    flash        how many bytes of flash the classifier may take; None: three quarters of the part's
    sensors      the known sensors of the glove whose readings a library converts; None: only the names are known

    Raises FirmwareError if the name cannot be used in C; MemberError if there is no such target.
    """

    tables: IntegerTables
    names: Names
    target: str
    name: str = LIBRARY_NAME
    flash: int | None = None
    sensors: Sensors | None = None

    def __post_init__(self) -> None:
        check_name(self.name)
        TARGETS.named(self.target)

    @property
    def _target(self) -> Target:
        return TARGETS.named(self.target)

    @cached_property
    def fit(self) -> PartFit:
        """The part of the target, and the layout of the build. Raises FirmwareError if it does not fit."""
        return fit_for(self._target, self.tables, self.flash)

    def library(self, notes: Sequence[str] = ()) -> Library:
        """Return the classifier alone, with lines for its opening comments."""
        return Library(self.name, self.names, self.fit.layout, tuple(notes), self.sensors)

    def files(self, notes: Sequence[str] | None = None) -> dict[str, str]:
        """Return path -> text of the firmware; the result is deterministic.

        notes are lines for the opening comment of the classifier's header, by default those of the fit. Raises
        FirmwareError where the build does not fit.
        """
        return self._target.files(self.library(self.fit.notes() if notes is None else notes))


SUMS = "SHA256SUMS"
# Bytes of one text; the tables of the largest build have fewer.
LARGEST = 64 << 20


def write_folder(files: Mapping[str, str], folder: Path, *, overwrite: bool = False) -> Path:
    """Write `files`, path below the folder -> text, as `folder`, with their checksums; return the resolved folder.

    With `overwrite` a folder that thenar wrote before is replaced; other files in it are kept. If the process is
    killed, the folder is either the old or the new one. Raises FirmwareError where a folder is not empty and may not be
    overwritten, was not written by thenar, or holds files of ours that were changed since, or the user's files where
    ours are to be written.
    """
    target, _ = check_folder(folder, _users_files, FirmwareError)
    if not overwrite and target.exists() and any(target.iterdir()):
        raise FirmwareError(f"{folder} already holds firmware: name another folder, or add ``overwrite``")
    content = {path: text.encode() for path, text in {**files, SUMS: sums(files)}.items()}
    return publish_folder(content, folder, _users_files, FirmwareError)


def sums(files: Mapping[str, str]) -> str:
    """Return the output of `sha256sum` for the files, in the order of their names."""
    return "".join(f"{_digest(text.encode())}  {path}\n" for path, text in sorted(files.items()))


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _users_files(folder: Path) -> list[str]:
    """Return the user's entries of the folder, sorted. Raises FirmwareError if our files may not be replaced."""
    there = entries(folder)
    if not there:
        return []
    if SUMS not in there:
        raise FirmwareError(f"{folder} is not empty and was not written by thenar: name another folder")
    ours = _read_sums(folder / SUMS)
    for path in sorted(ours.keys() & set(there)):
        if _digest(read_file(folder / path, LARGEST, FirmwareError)) != ours[path]:
            raise FirmwareError(f"{folder}/{path} was changed since thenar wrote it: move it, or name another folder")
    return [path for path in there if path not in ours and path != SUMS]


def _read_sums(path: Path) -> dict[str, str]:
    lines = read_file(path, LARGEST, FirmwareError).decode(errors="replace").splitlines()
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines) if name}
