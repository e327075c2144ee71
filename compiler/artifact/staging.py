"""Which folder a build may be published as, and what of it is a build's."""

from collections.abc import Mapping
from pathlib import Path

from thenar.runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, SCAN_NAME, TABLES_NAME

from ..firmware.classifier import FIRMWARE_NAME, LIBRARY_FILES
from ..glove.files import NAMES, users_files
from ..publication import check_folder, publish_folder, sweep
from .documents import REPORT_NAME, SPEC_FOLDER
from .errors import CompileError

# A build that was compiled for no harness has no scan map, one that is too large for any microcontroller no firmware,
# one without a report no spec.
MEMBERS = frozenset({MANIFEST_NAME, TABLES_NAME, ENSEMBLE_NAME, SCAN_NAME, REPORT_NAME})
_FOLDERS = {FIRMWARE_NAME: frozenset(LIBRARY_FILES), SPEC_FOLDER: NAMES}


def check_target(folder: Path) -> Path:
    """Return `folder` resolved, if a build may be put there: a new or empty folder, or one that holds only a build.

    Deletes the leftovers of killed publications next to it, and next to the spec in it. Raises CompileError where no
    build may be put: files that thenar has not made are never deleted.
    """
    spec = folder.resolve() / SPEC_FOLDER
    if spec.parent.is_dir():
        sweep(spec, users_files)
    return check_folder(folder, _refuse_foreign, CompileError)[0]


def publish(files: Mapping[str, bytes], target: Path) -> None:
    """Write `files`, path below the folder -> content, as `target`, in place of what `check_target` allows there.

    Killed, it leaves the old build or the new one, whole. Raises CompileError as `check_target` does.
    """
    # Again, because training takes its time and the folder is the user's.
    publish_folder(files, check_target(target), _refuse_foreign, CompileError)


def _refuse_foreign(folder: Path) -> tuple[str, ...]:
    """Return nothing: in a build nothing is the user's. Raises CompileError where something is."""
    if any(folder.iterdir()) and not (folder / MANIFEST_NAME).exists():
        raise CompileError(f"{folder} is not empty and not a build: name another folder, or empty this one")
    places = {folder / name: names for name, names in _FOLDERS.items()}
    inner = {place: names for place, names in places.items() if place.is_dir() and not place.is_symlink()}
    foreign = [path for path in _foreign(folder, MEMBERS) if path not in inner]
    foreign += [path for place, names in inner.items() for path in _foreign(place, names)]
    if foreign:
        name = foreign[0].relative_to(folder)
        raise CompileError(f"{folder} holds {name}, which is not of a build: move it, or name another folder")
    return ()


def _foreign(folder: Path, members: frozenset[str]) -> list[Path]:
    """Return the entries of `folder` that are not files with a member's name."""
    return [path for path in sorted(folder.iterdir()) if path.name not in members or not path.is_file()]
