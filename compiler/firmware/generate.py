"""The files of a firmware folder, from tables, target and mode; the folder is written atomically.

`SHA256SUMS`, which `sha256sum -c` reads, lists the files that thenar has written. Other files, such as a compiler's
objects, belong to the user and are kept.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from thenar.runtime.files import read_file
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.tables import IntegerTables

from ..publication import check_folder, entries, publish_folder
from . import FirmwareError
from .board import Board, check_switches, keys_of
from .board_files import (
    board_files,
    config_of,
    follows_segments,
    key_ports,
    segments_in_words,
    whole_folder,
)
from .choose import Fit, fit_for, smallest_fit
from .classifier import LIBRARY_NAME, Library
from .layout import Ports, ports_of_scan
from .protocol import protocol_files
from .sensors import Sensors
from .targets import TARGETS, Target
from .targets.base import Mode
from .words import Names, check_name


@dataclass(frozen=True, eq=False)
class Firmware:
    """Firmware of `tables` for `target`, one of TARGETS, in `mode`.

    names        the names of grasp types, switches and joints: a build's manifest, or words.numbered(tables)
    mode         "classify": a library; "scan": a board that scans switches; "glove": one that also recognises
    name         of its files and functions: lower-case letters, digits and _, at most 32
    board        how the microcontroller is wired; the modes scan and glove need it, the mode classify rejects it
    scan         how the build's harness is read, if it has one: a library takes its switches from these readings
    sensors      the known sensors of the glove whose readings a library converts; None: only the names are known
    flash        how many bytes of flash the classifier may take; None: three quarters of the part's

    Raises FirmwareError where these are inconsistent, or the name cannot be used in C; MemberError if there is no such
    target.
    """

    tables: IntegerTables
    names: Names
    target: str
    mode: Mode = "classify"
    name: str = LIBRARY_NAME
    board: Board | None = None
    flash: int | None = None
    scan: ScanMap | None = None
    sensors: Sensors | None = None

    def __post_init__(self) -> None:
        check_name(self.name)
        target = self._target
        if self.mode == "classify":
            if self.board is not None:
                raise FirmwareError("the mode classify reads no board: leave the board out, or use scan or glove")
        elif self.mode not in target.modes:
            *others, last = (name for name, each in TARGETS.items() if self.mode in each.modes)
            able = f"{', '.join(others)} and {last}"
            raise FirmwareError(f"the mode {self.mode} is available for {able}, not for {self.target}")
        elif self.board is None:
            raise FirmwareError(f"the mode {self.mode} needs a board.toml that describes the microcontroller's wiring")
        elif self.mode == "glove" and len(keys_of(self.board, self.names.switches)) < len(self.names.switches):
            raise FirmwareError(
                "the build keeps levels of taxels, which firmware of the mode glove cannot read: use the mode scan, "
                "and recognise on the host"
            )
        elif self.board.part != target.part:
            raise FirmwareError(f"the board has an {self.board.part}, but the target {self.target} is {target.named}")

    @property
    def _target(self) -> Target:
        return TARGETS.named(self.target)

    @cached_property
    def fit(self) -> Fit:
        """The part of the target, and the layout of the build. Raises FirmwareError if it does not fit."""
        if self.mode == "scan":  # a board that only scans contains no classifier
            return smallest_fit(self.tables, flash=self.flash)
        return fit_for(self._target, self.tables, self.flash, self._ports)

    @property
    def _ports(self) -> Ports | None:
        """The ports of the switches: eight consecutive keys of the board each, or readings of the build's harness.

        Raises FirmwareError if the board lacks a switch.
        """
        if self.board is None:
            return ports_of_scan(self.scan)
        keys = keys_of(self.board, self.names.switches)
        check_switches(self.board, keys)
        return key_ports(self.board, keys)

    @property
    def segments(self) -> str:
        """A sentence on whether the firmware of a glove follows segments; "" where its build has no segment costs."""
        return segments_in_words(self.board, self.names) if self.mode == "glove" and self.board is not None else ""

    def library(self, notes: Sequence[str] = ()) -> Library:
        """Return the classifier alone, with lines for its opening comments."""
        return Library(self.name, self.names, self.fit.layout, self.fit.target.avr, tuple(notes), self.sensors)

    def files(self, notes: Sequence[str] | None = None) -> dict[str, str]:
        """Return path -> text of the firmware; the result is deterministic.

        notes are lines for the opening comment of the classifier's header, by default those of the fit. Raises
        FirmwareError where the build does not fit, or the board cannot do what the mode needs.
        """
        library = self.library(self.fit.notes() if notes is None else notes)
        return self._target.files(library) if self.board is None else self._of_board(self.board, library)

    def _of_board(self, board: Board, library: Library) -> dict[str, str]:
        name, names, tables = self.name, self.names, self.tables
        switches, glove = keys_of(board, names.switches), self.mode == "glove"
        segments = glove and follows_segments(board, names)
        config = config_of(board, switches, tables, recognises=glove, segments=segments)
        files = protocol_files(config) | board_files(name, names, library.layout, board, self.mode)
        if glove:
            files |= library.files | (library.segments if segments else {})
        return whole_folder(name, board, self.mode, files)


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
        raise FirmwareError(f"{folder} already holds firmware: name another folder, or add --overwrite")
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
