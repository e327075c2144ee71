import subprocess
from pathlib import Path

import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.generate import SUMS, sums, write_folder

from ...conftest import tool

OLD = {"thenar_glove.c": "old\n", "examples/one/one.ino": "old\n", "gone.h": "old\n"}
NEW = {"thenar_glove.c": "new\n", "examples/one/one.ino": "new\n", "Makefile": "all:\n"}


def content(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_folder(OLD, tmp_path / "firmware")


def test_a_new_or_empty_folder_takes_the_files_and_their_sums(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for name in ("new", "empty"):
        folder = write_folder(NEW, tmp_path / name)
        assert content(folder) == {**NEW, SUMS: sums(NEW)}
        subprocess.run([tool("sha256sum"), "--check", "--strict", "--quiet", SUMS], cwd=folder, check=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "new"]


def test_firmware_is_replaced_only_where_that_is_asked_for(folder: Path) -> None:
    with pytest.raises(FirmwareError, match="already holds firmware: name another folder, or add ``overwrite``"):
        write_folder(NEW, folder)
    assert content(folder) == {**OLD, SUMS: sums(OLD)}
    write_folder(NEW, folder, overwrite=True)
    assert content(folder) == {**NEW, SUMS: sums(NEW)}
    assert [path.name for path in folder.parent.iterdir()] == ["firmware"]


def test_what_the_user_put_there_stays(folder: Path) -> None:
    mine = {"main.c": "int main(void)\n", "examples/one/notes": "mine", "build/thenar_glove.o": "object"}
    (folder / "build").mkdir()
    for path, text in mine.items():
        (folder / path).write_text(text)
    (folder / "link").symlink_to("main.c")
    write_folder(NEW, folder, overwrite=True)
    assert content(folder) == {**NEW, **mine, "link": "int main(void)\n", SUMS: sums(NEW)}
    assert (folder / "link").is_symlink()


def test_what_was_changed_since_is_not_replaced(folder: Path) -> None:
    (folder / "thenar_glove.c").write_text("better\n")
    with pytest.raises(FirmwareError, match=r"thenar_glove\.c was changed since thenar wrote it"):
        write_folder(NEW, folder, overwrite=True)
    assert (folder / "thenar_glove.c").read_text() == "better\n"


@pytest.mark.parametrize("name", [SUMS, "thenar_glove.c"])
def test_a_link_to_what_never_ends_is_refused_unread(folder: Path, name: str) -> None:
    (folder / name).unlink()
    (folder / name).symlink_to("/dev/zero")
    with pytest.raises(FirmwareError, match="is a device or a pipe"):
        write_folder(NEW, folder, overwrite=True)


def test_a_folder_of_somebody_elses_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "firmware").mkdir()
    (tmp_path / "firmware" / "main.c").write_text("mine")
    with pytest.raises(FirmwareError, match="is not empty and was not written by thenar"):
        write_folder(NEW, tmp_path / "firmware", overwrite=True)
    assert content(tmp_path / "firmware") == {"main.c": "mine"}


def test_a_place_that_cannot_be_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FirmwareError, match="file is a file: name a folder"):
        write_folder(NEW, tmp_path / "file")
    with pytest.raises(FirmwareError, match="nowhere is no folder: make it first"):
        write_folder(NEW, tmp_path / "nowhere" / "firmware")
