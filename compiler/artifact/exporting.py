"""Write the classifier of a build as C."""

from pathlib import Path

from thenar.runtime.build import Build

from ..firmware.classifier import LIBRARY_NAME
from ..firmware.generate import firmware_files, write_folder


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
