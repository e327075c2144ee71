"""A folder that holds a spec: written whole or not at all; what the user put there is kept."""

from collections.abc import Mapping
from pathlib import Path

from ..publication import check_folder, entries, publish_folder
from .errors import SpecError
from .files import NAMES

_MARK = "spec.json"


def check_output(folder: Path) -> None:
    """Raise SpecError unless a spec may be put there: a new or empty folder, or one that holds a spec."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    check_folder(folder, users_files, SpecError)


def write_spec(files: Mapping[str, bytes], folder: Path) -> None:
    """Write the files of a spec as `folder`, in place of an older spec. Raises SpecError as `check_output` does."""
    publish_folder(files, folder, users_files, SpecError)


def users_files(folder: Path) -> list[str]:
    """Return the user's entries of the folder of a spec. Raises SpecError if it holds no spec."""
    if any(folder.iterdir()) and not (folder / _MARK).is_file():
        raise SpecError(f"{folder} is there already and is no spec: name another folder")
    return [path for path in entries(folder) if path not in NAMES]
