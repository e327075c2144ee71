"""The files of a firmware folder, from tables and a target; the folder is written atomically.

`SHA256SUMS`, which `sha256sum -c` reads, lists the files that thenar has written. Other files, such as a compiler's
objects, belong to the user and are kept.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from thenar.runtime.build import Build
from thenar.runtime.files import read_file
from thenar.runtime.manifest import Manifest
from thenar.runtime.model.integers import IntegerTables

from ..publication import check_folder, entries, publish_folder
from . import FirmwareError
from .classifier import LIBRARY_NAME, Library
from .costs import fit_for
from .targets import TARGETS


def firmware_files(
    tables: IntegerTables, names: Manifest, target: str, name: str = LIBRARY_NAME, flash: int | None = None
) -> dict[str, str]:
    """Return path -> text of the library that classifies frames by `tables`; the result is deterministic.

    names   of grasp types, switches and joints: a build's manifest, or words.numbered(tables)
    target  one of TARGETS
    name    of its files and functions: lower-case letters, digits and _, at most 32
    flash   how many bytes of flash the classifier may take; None: three quarters of the part's

    Raises FirmwareError if the name cannot be used in C, or the build does not fit; SettingError if there is no such
    target.
    """
    member = TARGETS.named(target)
    fit = fit_for(member, tables, flash)
    return member.files(Library(name, names, fit.layout, fit.notes()))


def export_c(
    build: Build,
    folder: str | Path,
    target: str = "avr328p",
    *,
    name: str = LIBRARY_NAME,
    flash: int | None = None,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Write C99 that predicts exactly as a build does into `folder`, and return the files.

    Parameters
    ----------
    build : Build
        The build, loaded.
    folder : path
        The folder to write.
    target : str
        The name of `thenar firmware --target`: one of `TARGETS`.
    name : str
        The prefix of every C name.
    flash : int, optional
        Bytes of flash that the classifier may use; None: three quarters of the part's flash.
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    SettingError
        If there is no such target.
    FirmwareError
        If the build does not fit the target.

    Examples
    --------
    >>> from thenar.compiler import Build, GraspSet, compile_build, export_c
    >>> report = compile_build(GraspSet.load("set.grasps"), "build", rounds=3, folds=0)
    >>> sorted(path.name for path in export_c(Build.load("build"), "firmware", "host"))[:2]
    ['Makefile', 'check.c']
    """
    files = firmware_files(build.tables, build.manifest, target, name, flash)
    write_folder(files, Path(folder), overwrite=overwrite)
    return tuple(Path(folder) / path for path in files)


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
    return "".join(f"{hashlib.sha256(text.encode()).hexdigest()}  {path}\n" for path, text in sorted(files.items()))


def _users_files(folder: Path) -> list[str]:
    """Return the user's entries of the folder, sorted. Raises FirmwareError if our files may not be replaced."""
    there = entries(folder)
    if not there:
        return []
    if SUMS not in there:
        raise FirmwareError(f"{folder} is not empty and was not written by thenar: name another folder")
    lines = read_file(folder / SUMS, LARGEST, FirmwareError).decode(errors="replace").splitlines()
    ours = {path: digest for digest, _, path in (line.partition("  ") for line in lines) if path}
    for path in sorted(ours.keys() & set(there)):
        if hashlib.sha256(read_file(folder / path, LARGEST, FirmwareError)).hexdigest() != ours[path]:
            raise FirmwareError(f"{folder}/{path} was changed since thenar wrote it: move it, or name another folder")
    return [path for path in there if path not in ours and path != SUMS]
