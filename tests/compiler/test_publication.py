import fcntl
import json
import os
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

import pytest

from thenar.compiler import publication
from thenar.compiler.publication import check_folder, entries, publish_folder, sweep
from thenar.drivers.errors import ThenarError

from .conftest import content

SCRIPT = Path(__file__).with_name("killed_publications.py")
OURS = {"a", "b", "inner/c"}
OLD = {"a": b"old", "b": b"old"}
NEW = {"a": b"new", "inner/c": b"new"}
MINE = {"mine", "inner/mine"}


def theirs(folder: Path) -> Collection[str]:
    there = entries(folder)
    if "refuse" in there:
        raise ThenarError("refused")
    return [path for path in there if path not in OURS]


def publish(files: dict[str, bytes], folder: Path) -> Path:
    return publish_folder(files, folder, theirs, ThenarError)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A published folder with files of the user's."""
    publish(OLD, tmp_path / "folder")
    (tmp_path / "folder" / "inner").mkdir()
    for path in MINE:
        (tmp_path / "folder" / path).write_text("mine")
    return tmp_path / "folder"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "system"),
    [
        *((kind, "exchange") for kind in ("build", "spec", "firmware", "frontier")),
        *((kind, "renames") for kind in ("build", "firmware")),
        *((kind, "renames, no links") for kind in ("spec", "frontier")),
    ],
)
def test_killed_at_any_instant_the_folder_is_old_or_new(kind: str, system: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, SCRIPT, kind, system, tmp_path / "work"], stdout=subprocess.PIPE, check=True, text=True
    )
    kills = json.loads(done.stdout)
    assert len(kills) > 30
    for instant, (found, old_is_there, next_found, next_beside) in enumerate(kills, 1):
        if system != "exchange" and found == "none":
            assert old_is_there, f"neither the old files nor the new ones are there at instant {instant}"
        else:
            assert found in ("old", "new"), f"{found} at instant {instant}"
        assert (next_found, next_beside) == ("new", ["folder"]), f"what instant {instant} left was not cleared"
    assert (kills[0][0], kills[-1][0]) == ("old", "new")


@pytest.mark.parametrize("links", [True, False])
@pytest.mark.parametrize("exchanges", [True, False])
def test_what_is_the_users_is_in_the_new_folder(
    folder: Path, links: bool, exchanges: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_links(*_: object, **__: object) -> None:
        raise OSError("there are no hard links")

    if not exchanges:
        monkeypatch.setattr(publication, "exchanged", lambda _one, _other: False)
    if not links:
        monkeypatch.setattr(os, "link", no_links)
    (folder / "empty").mkdir()
    (folder / "dangling").symlink_to("nowhere")
    inode = (folder / "mine").stat().st_ino
    assert publish(NEW, folder) == folder
    assert content(folder) == {"a": "new", "inner/c": "new", "mine": "mine", "inner/mine": "mine"}
    assert ((folder / "mine").stat().st_ino == inode) == links
    assert (folder / "empty").is_dir()
    assert (folder / "dangling").readlink() == Path("nowhere")
    assert names(folder.parent) == ["folder"]


def test_two_names_are_exchanged_at_one_instant(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).touch()
    assert publication.exchanged(tmp_path / "one", tmp_path / "two")
    assert (names(tmp_path / "one"), names(tmp_path / "two")) == (["two"], ["one"])
    with pytest.raises(FileNotFoundError):
        publication.exchanged(tmp_path / "one", tmp_path / "none")


@pytest.mark.parametrize("exchanges", [True, False])
@pytest.mark.parametrize("change", ["added", "replaced", "refused"])
def test_what_the_user_does_while_the_folder_is_replaced_is_not_lost(
    folder: Path, change: str, exchanges: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    put = publication._put

    def meanwhile(box: Path, target: Path) -> Path | None:
        (folder / {"added": "later", "replaced": "saved", "refused": "refuse"}[change]).write_text("later")
        if change == "replaced":
            (folder / "saved").rename(folder / "mine")
        return put(box, target)

    monkeypatch.setattr(publication, "_put", meanwhile)
    if not exchanges:
        monkeypatch.setattr(publication, "exchanged", lambda _one, _other: False)
    reason = "refused" if change == "refused" else "was changed while it was replaced: run this again"
    with pytest.raises(ThenarError, match=reason):
        publish(NEW, folder)
    kept = {"a": "old", "b": "old", "inner/mine": "mine"}
    changed = {"added": {"mine": "mine", "later": "later"}, "replaced": {"mine": "later"}}
    assert content(folder) == {**kept, **changed.get(change, {"mine": "mine", "refuse": "later"})}
    assert names(folder.parent) == ["folder"]


def test_leftovers_of_a_kill_with_unique_files_stay(folder: Path) -> None:
    box = folder.with_name(".folder.01234567.part")
    for place in ("new", "gone", "part"):
        (box / place).mkdir(parents=True)
        (box / place / "mine").write_text("an older one")
    publish(NEW, folder)
    assert content(box) == {"new/mine": "an older one"}
    (folder / "mine").write_text("an older one")
    publish(NEW, folder)
    assert names(folder.parent) == ["folder"]


def test_what_a_living_process_writes_is_not_cleared(folder: Path) -> None:
    box = folder.with_name(".folder.01234567.part")
    (box / "part").mkdir(parents=True)
    lock = os.open(box, os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    publish(NEW, folder)
    assert names(folder.parent) == [box.name, "folder"]
    os.close(lock)
    sweep(folder, theirs)
    assert names(folder.parent) == ["folder"]


def test_files_links_and_foreign_folders_of_temporary_names_stay(folder: Path, tmp_path: Path) -> None:
    (tmp_path / ".folder.01234567.part").write_text("mine")
    (tmp_path / ".folder.01234568.part").symlink_to(folder)
    (tmp_path / ".other.01234567.part" / "part").mkdir(parents=True)
    before = names(tmp_path)
    publish(NEW, folder)
    assert names(tmp_path) == before


def test_a_ctrl_c_between_two_renames_brings_the_old_folder_back(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rename = Path.rename

    def interrupted(self: Path, target: Path) -> Path:
        if target == folder and self.name == "new":
            raise KeyboardInterrupt
        return rename(self, target)

    before = content(folder)
    monkeypatch.setattr(publication, "exchanged", lambda _one, _other: False)
    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt):
        publish(NEW, folder)
    assert content(folder) == before
    assert names(folder.parent) == ["folder"]


def test_a_full_disk_leaves_the_old_folder_and_the_message_names_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    before = content(folder)
    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left") as caught:
        publish(NEW, folder)
    assert caught.value.filename == str(folder)
    assert content(folder) == before
    assert names(folder.parent) == ["folder"]


@pytest.mark.parametrize("path", ["a", "inner/c", "inner"])
def test_a_users_file_in_the_way_is_not_replaced(tmp_path: Path, path: str) -> None:
    (tmp_path / "folder" / path).parent.mkdir(parents=True)
    (tmp_path / "folder" / path).write_text("mine")
    with pytest.raises(ThenarError, match=f"holds {path}, which thenar has not written"):
        publish_folder(NEW, tmp_path / "folder", entries, ThenarError)
    assert content(tmp_path / "folder") == {path: "mine"}


def test_a_folder_that_appears_meanwhile_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rename = Path.rename

    def meanwhile(self: Path, target: Path) -> Path:
        if target == tmp_path / "folder":
            target.mkdir()
            (target / "mine").write_text("mine")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", meanwhile)
    with pytest.raises(ThenarError, match=r"another program made .* meanwhile"):
        publish(NEW, tmp_path / "folder")
    assert content(tmp_path / "folder") == {"mine": "mine"}
    assert names(tmp_path) == ["folder"]


def test_the_current_folder_is_not_exchanged_under_its_shell(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for current in (folder, folder / "inner"):
        monkeypatch.chdir(current)
        with pytest.raises(ThenarError, match="is a mount point or the current folder"):
            check_folder(folder, theirs, ThenarError)


def test_a_place_that_cannot_be_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for place, reason in (
        ("file", "file is a file"),
        ("no/folder", "no is no folder: make it first"),
        ("/", "mount point"),
    ):
        with pytest.raises(ThenarError, match=reason):
            check_folder(tmp_path / place, theirs, ThenarError)


def test_through_a_link_the_folder_behind_it_is_written(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(folder)
    assert publish(NEW, tmp_path / "link") == folder
    assert (tmp_path / "link").is_symlink()
    assert (folder / "a").read_bytes() == b"new"
