"""A package of somebody else's, installed beside thenar for one test."""

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.graspset import Joint

from ..sets import grasp_set_of

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
SCENE = """
seed = 3
taxonomy = "kamakura14"
objects = "kamakura14"
repetitions = {repetitions}

[recording]
hold_ms = 20

[[subjects]]
name = "A"
hand_length_mm = 188
hand_breadth_mm = 84
"""


@pytest.fixture(scope="session")
def scene() -> Callable[[int], str]:
    """Return what makes the scene of one subject and so many repetitions, to which tables may be added."""
    return lambda repetitions: SCENE.format(repetitions=repetitions)


def sixty(switches: Any, codes: Any = ((),) * 60, joints: tuple[str, ...] = (), names: Any = "") -> GraspSet:
    """Return sixty trials of three types in turn from their switches, codes and names of joints."""
    named = tuple(Joint(name, "deg", 0, 0.0, 255, 127.5) for name in joints)
    types = names or ("cup", "pen", "rod")
    return grasp_set_of(types, np.arange(60) % 3, switches=switches, codes=codes, joints=named)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `set.grasps`, in which each type closes a switch of its own, and with `build`, made of it."""
    folder = tmp_path_factory.mktemp("recorded")
    grasp_set = sixty(np.eye(3)[np.arange(60) % 3])
    grasp_set.save(folder / "set.grasps")
    compile_build(grasp_set, folder / "build", rounds=10, folds=0, inputs="switches")
    return folder


@pytest.fixture
def install(tmp_path: Path) -> Install:
    """Install a file of examples/extending as a distribution with an entry point for its MEMBER (file, group, name of
    the point), and for the objects of other groups.
    """

    def installed(
        file: str, group: str, name: str = "member", others: Mapping[str, str] = MappingProxyType({})
    ) -> Installed:
        folder = tmp_path / "site"
        metadata = folder / "somebody_else-1.0.dist-info"
        metadata.mkdir(parents=True)
        module = f"somebody_elses_{Path(file).stem}"
        (folder / f"{module}.py").write_bytes((EXAMPLES / file).read_bytes())
        (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: somebody-else\nVersion: 1.0\n")
        points = [(group, name, "MEMBER"), *((group, name, what) for group, what in others.items())]
        lines = (f"[{group}]\n{point} = {module}:{what}\n" for group, point, what in points)
        (metadata / "entry_points.txt").write_text("".join(lines))
        return Installed(folder)

    return installed
