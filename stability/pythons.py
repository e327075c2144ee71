"""The other Pythons of this machine: those that there are, and those that `make pythons` has given a thenar."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

SUPPORTED = ("3.11", "3.12", "3.13", "3.14")
VARIABLE = "THENAR_PYTHONS"  # interpreters that have thenar, as a list like PATH, in place of the folders
ROOT = Path(__file__).resolve().parents[1]

_RUNS = "import ensurepip, platform; print(platform.python_version())"


def made() -> list[Path]:
    """Return the interpreters that thenar is installed for: of THENAR_PYTHONS, else of the repository's `.venv-3.x`."""
    listed = os.environ.get(VARIABLE)
    if listed is not None:
        return [Path(entry) for entry in listed.split(os.pathsep) if entry]
    folders = (ROOT / f".venv-{version}" for version in SUPPORTED)
    return [folder / "bin" / "python" for folder in folders if (folder / "installed").exists()]


def found() -> Iterator[tuple[str, Path]]:
    """Yield (version "3.x", interpreter) of every supported Python but this one that really runs here."""
    for version in SUPPORTED:
        if version == f"{sys.version_info.major}.{sys.version_info.minor}":
            continue
        running = next((python for python in _candidates(version) if _runs(python, version)), None)
        if running is not None:
            yield version, running


def _candidates(version: str) -> Iterator[Path]:
    """Yield what could be an interpreter of `version`: first along the PATH, then pyenv's, whose shims may refuse."""
    for folder in os.get_exec_path():
        if (file := shutil.which(f"python{version}", path=folder)) is not None:
            yield Path(file)
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    yield from sorted(pyenv.glob(f"versions/{version}.*/bin/python{version}"))


def _runs(python: Path, version: str) -> bool:
    answer = subprocess.run([python, "-I", "-c", _RUNS], capture_output=True, text=True, check=False)
    return answer.returncode == 0 and answer.stdout.startswith(version + ".")


if __name__ == "__main__":
    for version, python in found():
        print(version, python)
