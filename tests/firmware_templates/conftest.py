"""Our C as shared libraries, for Python to call."""

import ctypes
from collections.abc import Callable, Mapping

import pytest

from thenar.compiler.firmware.tools import call, compile_objects

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
        command = [tool("gcc"), *FLAGS, *flags]
        call([*command, *compile_objects(command, sources, folder), "-o", "made.so"], folder)
        return ctypes.CDLL(str(folder / "made.so"))

    return load
