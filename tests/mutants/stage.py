"""Stage a throw-away copy of the sources under the names they are imported by, with the tests: to break it on purpose.

    python tests/mutants/stage.py FOLDER

FOLDER/thenar/... comes before the installed thenar when FOLDER is on PYTHONPATH.
"""

import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def stage(folder: Path) -> None:
    """Copy the package, its links followed, and the tests into the new or empty `folder`."""
    leave_out = shutil.ignore_patterns("__pycache__")
    for name, place in {"thenar": "src/thenar", "tests": "tests"}.items():
        shutil.copytree(ROOT / place, folder / name, ignore=leave_out)
    shutil.copy(ROOT / "pyproject.toml", folder)


if __name__ == "__main__":
    stage(Path(sys.argv[1]))
