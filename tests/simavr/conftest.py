"""The harness's programs, compiled, and small AVR programs for them."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.avr import harness

from ..conftest import tool

Compile = Callable[..., Path]


@pytest.fixture(scope="session")
def program() -> Callable[[str], Path]:
    """Return what gives the path of a program of the harness."""
    for name in ("avr-gcc", "make"):
        tool(name)
    if (gone := TARGETS["avr328p"].missing()) is not None:
        assert "libsimavr" in gone, gone
        tool("libsimavr-dev")
    return harness


@pytest.fixture
def compiled(tmp_path: Path) -> Compile:
    """Return what compiles a text, C or (suffix ".S") assembly, for a part."""

    def compiled(text: str, part: str, suffix: str = ".c") -> Path:
        source, elf = tmp_path / f"program{suffix}", tmp_path / "program.elf"
        source.write_text(text)
        command = [tool("avr-gcc"), f"-mmcu={part}", "-Os", "-Wall", "-Wextra", "-Werror", str(source), "-o", str(elf)]
        subprocess.run(command, check=True, timeout=60)
        return elf

    return compiled
