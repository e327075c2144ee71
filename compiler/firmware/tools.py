"""Compilers and emulators: finding them and running them, with a time limit, in a temporary folder."""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

from . import FirmwareError

LIMIT_S = 300.0
# All of our C files are compiled with these.
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic")

# The first installed program of each tuple is used; the packages are Debian's.
Tool = tuple[tuple[str, ...], str]
HOST_COMPILER: Tool = (("gcc", "clang"), "gcc")
AVR_COMPILER: Tool = (("avr-gcc",), "gcc-avr avr-libc")
ARM_COMPILER: Tool = (("arm-none-eabi-gcc",), "gcc-arm-none-eabi")
RISCV_COMPILER: Tool = (("riscv64-unknown-elf-gcc",), "gcc-riscv64-unknown-elf")


def lacking(*tools: Tool) -> str | None:
    """Return which of the tools are not installed and which packages contain them, None if all are installed."""
    gone = [tool for tool in tools if not any(map(shutil.which, tool[0]))]
    if not gone:
        return None
    programs = " and ".join(" or ".join(names) for names, _ in gone)
    return f"{programs} not found; Debian: apt-get install {' '.join(package for _, package in gone)}"


def find(tool: Tool) -> str:
    """Return the path of the first installed program of `tool`. Raises FirmwareError if there is none."""
    for name in tool[0]:
        if path := shutil.which(name):
            return path
    raise FirmwareError(lacking(tool))


@contextmanager
def workshop(files: Mapping[str, str | bytes]) -> Iterator[Path]:
    """Create a temporary folder with `files`, path below it -> content; it is removed at the end of the block.

    Raises FirmwareError if they cannot be written.
    """
    try:
        folder = TemporaryDirectory(prefix="thenar-")
    except OSError as wrong:
        raise FirmwareError(f"no temporary folder: {wrong.strerror}; set $TMPDIR to another place") from None
    with folder as name:
        for path, content in files.items():
            inside = Path(name, path)
            try:
                inside.parent.mkdir(parents=True, exist_ok=True)
                inside.write_bytes(content.encode() if isinstance(content, str) else content)
            except OSError as wrong:
                raise FirmwareError(f"{inside} cannot be written: {wrong.strerror}; is the disk full?") from None
        yield Path(name)


def call(command: Sequence[str], folder: Path, given: bytes = b"", limit_s: float = LIMIT_S) -> bytes:
    """Run `command` in `folder` with `given` on its standard input; return its output.

    Raises FirmwareError with the beginning of its messages if it ends with an error or not within `limit_s`.
    """
    program = Path(command[0]).name
    english = os.environ | {"LC_ALL": "C"}
    try:
        done = subprocess.run(
            command, cwd=folder, input=given, capture_output=True, timeout=limit_s, env=english, check=False
        )
    except subprocess.TimeoutExpired:
        raise FirmwareError(f"{program} was stopped, since it had not ended after {limit_s:g} s") from None
    except OSError as wrong:
        raise FirmwareError(f"{program} cannot be started: {wrong.strerror}") from None
    if done.returncode:
        said = (done.stderr or done.stdout).decode(errors="replace").strip()
        raise FirmwareError(f"{program} ended with {done.returncode}: {said[:2000] or 'without a message'}")
    return done.stdout


_INCLUDED = re.compile(rb'^#include "([^"]+)"', re.MULTILINE)


def compile_objects(command: Sequence[str], sources: Sequence[str], folder: Path) -> list[str]:
    """Compile files of `folder`, which has no folders in it, by `command`; return the names of the objects.

    The core has the same text in every build, and takes most of the time: what was compiled of the same texts by the
    same command, in this process, is not compiled again.

    Raises FirmwareError as `call` does.
    """
    objects = []
    for source in sources:
        names = [source]
        for name in names:
            included = (each.decode() for each in _INCLUDED.findall((folder / name).read_bytes()))
            names += [each for each in included if each not in names and (folder / each).is_file()]
        texts = tuple((name, (folder / name).read_bytes()) for name in names)
        objects.append(f"{source}.o")
        (folder / objects[-1]).write_bytes(_object(tuple(command), texts))
    return objects


@lru_cache(maxsize=32)
def _object(command: tuple[str, ...], texts: tuple[tuple[str, bytes], ...]) -> bytes:
    """Return the object of the first of `texts`; the others are all that it includes."""
    with workshop(dict(texts)) as folder:
        call([*command, "-c", texts[0][0], "-o", "object"], folder)
        return (folder / "object").read_bytes()
