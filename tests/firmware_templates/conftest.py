"""Our C as shared libraries, for Python to call."""

import ctypes
import subprocess
from collections.abc import Callable, Mapping

import pytest

from ..conftest import tool

SharedLibrary = Callable[..., ctypes.CDLL]
# What undefined behaviour does is to stop the test.
FLAGS = ("-std=c99", "-O1", "-g", "-shared", "-fPIC", "-fsanitize=undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="session")
def shared_library(tmp_path_factory: pytest.TempPathFactory) -> SharedLibrary:
    """Return a function that compiles files, name -> text, with gcc and loads them; each call gives its own statics."""

    def load(files: Mapping[str, str], *flags: str) -> ctypes.CDLL:
        folder = tmp_path_factory.mktemp("library")
        for name, text in files.items():
            (folder / name).write_text(text)
        sources = [name for name in files if name.endswith(".c")]
        command = [tool("gcc"), *FLAGS, *flags, *sources, "-o", "made.so"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return ctypes.CDLL(str(folder / "made.so"))

    return load
