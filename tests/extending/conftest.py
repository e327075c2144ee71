"""A package of somebody else's, installed beside thenar for one test."""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples" / "extending"


@dataclass(frozen=True)
class Installed:
    """A folder with one module and the metadata of a distribution, as pip writes them into site-packages."""

    folder: Path

    def thenar(self, *arguments: str, code: int = 0) -> str:
        """Run the command `thenar` where the distribution is installed, and return what it printed."""
        path = os.pathsep.join([str(self.folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        done = subprocess.run(
            [sys.executable, "-P", "-m", "thenar.cli", *arguments],
            env={**os.environ, "PYTHONPATH": path, "COLUMNS": "200"},
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == code, done.stdout + done.stderr
        return done.stdout if code == 0 else done.stderr


Install = Callable[..., Installed]


@pytest.fixture
def install(tmp_path: Path) -> Install:
    """Install a file of examples/extending as a distribution with one entry point: file, group, name of the point."""

    def installed(file: str, group: str, name: str = "member") -> Installed:
        folder = tmp_path / "site"
        metadata = folder / "somebody_else-1.0.dist-info"
        metadata.mkdir(parents=True)
        module = f"somebody_elses_{Path(file).stem}"
        (folder / f"{module}.py").write_bytes((EXAMPLES / file).read_bytes())
        (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: somebody-else\nVersion: 1.0\n")
        (metadata / "entry_points.txt").write_text(f"[{group}]\n{name} = {module}:MEMBER\n")
        return Installed(folder)

    return installed
