"""The other Pythons of this machine: those installed, and those in which `make pythons` has installed thenar."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

SUPPORTED = ("3.11", "3.12", "3.13", "3.14")
VARIABLE = "THENAR_PYTHONS"  # interpreters with thenar, a list like PATH, used instead of the folders
ROOT = Path(__file__).resolve().parents[1]

_RUNS = "import ensurepip, platform; print(platform.python_version())"


def made() -> list[Path]:
    """Return the interpreters with thenar installed: from THENAR_PYTHONS, else the repository's `.venv-3.x`."""
    listed = os.environ.get(VARIABLE)
    if listed is not None:
        return [Path(entry) for entry in listed.split(os.pathsep) if entry]
    folders = (ROOT / f".venv-{version}" for version in SUPPORTED)
    return [folder / "bin" / "python" for folder in folders if (folder / "installed").exists()]


def found() -> Iterator[tuple[str, Path]]:
    """Yield (version "3.x", interpreter) of every other supported Python that runs here."""
    for version in SUPPORTED:
        if version == f"{sys.version_info.major}.{sys.version_info.minor}":
            continue
        running = next((python for python in _candidates(version) if _runs(python, version)), None)
        if running is not None:
            yield version, running


def _candidates(version: str) -> Iterator[Path]:
    """Yield candidates for an interpreter of `version`: first on the PATH, then pyenv's, whose shims may fail."""
    for folder in os.get_exec_path():
        if (file := shutil.which(f"python{version}", path=folder)) is not None:
            yield Path(file)
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    yield from sorted(pyenv.glob(f"versions/{version}.*/bin/python{version}"))


def _runs(python: Path, version: str) -> bool:
    output = subprocess.run([python, "-I", "-c", _RUNS], capture_output=True, text=True, check=False)
    return output.returncode == 0 and output.stdout.startswith(version + ".")


if __name__ == "__main__":
    for version, python in found():
        print(version, python)
