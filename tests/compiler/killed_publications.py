"""Publishes over an old folder again and again, each time killed one instant later, and prints what each kill left.

    python tests/compiler/killed_publications.py KIND SYSTEM FOLDER

An instant lies before every call that changes the disk, and before every line that may exchange or rename the folder:
`SIGKILL` comes there. SYSTEM is what the file
system can do: "exchange", "renames" or "renames, no links". Prints a JSON list of `Left`.
"""

import json
import os
import shutil
import signal
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any, NamedTuple

from thenar.compiler import publication
from thenar.compiler.artifact import compile as artifact
from thenar.compiler.firmware import generate as firmware
from thenar.compiler.frontier.cache import Store
from thenar.compiler.frontier.find import kept_entries
from thenar.compiler.frontier.points import FrontierError
from thenar.compiler.glove import files as spec

Content = Mapping[str, str]
TRACED = {function.__code__ for function in (publication.publish_folder, publication._put, publication.exchanged)}
# As Python audits them.
CHANGES = {"open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "fcntl.flock", "shutil.copyfile"}


class Kind(NamedTuple):
    """What is published over what, what is then `written`, and what of the user's (or the store) is to survive."""

    old: Content
    new: Content
    written: Content
    kept: Content
    publish: Callable[[Content, Path], object]


class Left(NamedTuple):
    """After a kill: "old", "new", "none" or "mix" in the folder, whether each file of the old one is somewhere; and
    after another run: the same of the folder, and what is beside it.
    """

    found: str
    old_is_there: bool
    next_found: str
    next_beside: list[str]


def _encoded(files: Content) -> dict[str, bytes]:
    return {path: text.encode() for path, text in files.items()}


def _publish_frontier(files: Content, folder: Path) -> None:
    publication.check_folder(folder, kept_entries, FrontierError)
    folder.mkdir(exist_ok=True)
    with Store(folder / "store.sqlite", "scope") as store:
        store.finish()
        publication.publish_folder(_encoded(files), folder, kept_entries, FrontierError)


def _empty_store() -> str:
    with TemporaryDirectory() as folder:
        Store(Path(folder) / "store.sqlite", "scope").close()
        return (Path(folder) / "store.sqlite").read_bytes().decode("latin-1")


BUILD = {"build.json": "new", "ensemble.bin": "new", "spec/spec.json": "new"}
SPEC = {"spec.json": "new", "bom.csv": "new"}
FIRMWARE = {"thenar_glove.c": "new\n", "examples/one/one.ino": "new\n", "Makefile": "all:\n"}
FRONTIER = {"frontier.json": "new", "frontier.csv": "new", "frontier.svg": "new"}
OLD_FIRMWARE = {"thenar_glove.c": "old\n", "examples/one/one.ino": "old\n", "gone.h": "old\n"}

KINDS = {
    "build": Kind(
        {"build.json": "old", "tables.bin": "old", "firmware/thenar_glove.c": "old", "spec/spec.json": "old"},
        *(BUILD, BUILD, {}),
        lambda files, folder: artifact.publish(_encoded(files), artifact.check_target(folder)),
    ),
    "spec": Kind(
        {"spec.json": "old", "bom.csv": "old", "cutting.svg": "old"},
        *(SPEC, SPEC, {"notes.txt": "mine"}),
        lambda files, folder: spec.write_spec(_encoded(files), folder),
    ),
    "firmware": Kind(
        {**OLD_FIRMWARE, firmware.SUMS: firmware.sums(OLD_FIRMWARE)},
        FIRMWARE,
        {**FIRMWARE, firmware.SUMS: firmware.sums(FIRMWARE)},
        {"main.c": "mine", "examples/one/notes": "my notes", "build/thenar_glove.o": "object"},
        lambda files, folder: firmware.write_folder(files, folder, overwrite=True),
    ),
    "frontier": Kind(
        {"frontier.json": "old", "frontier.csv": "old", "frontier.svg": "old"},
        *(FRONTIER, FRONTIER, {"store.sqlite": _empty_store(), "sub/set.grasps": "mine"}),
        _publish_frontier,
    ),
}


def _before(kind: Kind, folder: Path) -> None:
    shutil.rmtree(folder.parent, ignore_errors=True)
    for path, text in {**kind.old, **kind.kept}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(text.encode("latin-1"))


def _content(folder: Path) -> Content:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes().decode("latin-1") for path in files}


def _found(kind: Kind, folder: Path) -> str:
    if not folder.exists():
        return "none"
    there = _content(folder)
    wholes = {"old": {**kind.old, **kind.kept}, "new": {**kind.written, **kind.kept}}
    return next((name for name, whole in wholes.items() if whole == there), "mix")


def _limit(system: str) -> None:
    """Take from this process what the file system shall not be able to do."""

    def no_links(*_: object, **__: object) -> None:
        raise OSError("there are no hard links")

    if system != "exchange":
        publication.exchanged = lambda one, other: False
    if system == "renames, no links":
        os.link = no_links
    os.fsync = lambda fd: None  # a kill, unlike a power cut, loses nothing that was written


def _killed_at(instant: int, work: Callable[[], object]) -> bool:
    """Do the work in a child that is killed at that instant; return whether there was one."""
    pid = os.fork()
    if not pid:
        _die_at(instant)
        work()
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL


def _die_at(instant: int) -> None:
    left = instant

    def tick() -> None:
        nonlocal left
        left -= 1
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    def trace(frame: FrameType, event: str, _argument: Any) -> Any:
        if frame.f_code not in TRACED:
            return None
        if event == "line":
            tick()
        return trace

    def audit(event: str, _arguments: object) -> None:
        if event in CHANGES:
            tick()

    sys.addaudithook(audit)
    sys.settrace(trace)


def main(kind: Kind, system: str, parent: Path) -> list[Left]:
    """Return what each kill left, from the first instant to the last."""
    _limit(system)
    folder, left = parent / "folder", list[Left]()

    def publish() -> object:
        return kind.publish(kind.new, folder)

    while True:
        _before(kind, folder)
        if not _killed_at(len(left) + 1, publish):
            return left
        found, everywhere = _found(kind, folder), [*_content(parent).values()]
        old_is_there = all(text in everywhere for text in {**kind.old, **kind.kept}.values())
        publish()
        left.append(Left(found, old_is_there, _found(kind, folder), sorted(path.name for path in parent.iterdir())))


if __name__ == "__main__":
    print(json.dumps(main(KINDS[sys.argv[1]], sys.argv[2], Path(sys.argv[3]))))
