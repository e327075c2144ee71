import os
from pathlib import Path

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.files import read_file, write_atomically

from ..conftest import peak_bytes


def test_an_old_file_is_replaced_and_nothing_is_beside_it(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(b"a longer old content")
    write_atomically(tmp_path / "a.bin", b"new")
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("a.bin", b"new")]


def test_when_the_rename_fails_nothing_is_left_behind(tmp_path: Path) -> None:
    (tmp_path / "a.bin").mkdir()
    with pytest.raises(IsADirectoryError):
        write_atomically(tmp_path / "a.bin", b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["a.bin"]


def test_an_interrupt_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_descriptor: int) -> None:
        raise KeyboardInterrupt

    (tmp_path / "a.bin").write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(tmp_path / "a.bin", b"new")
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("a.bin", b"old")]


@pytest.mark.parametrize("name", ["pipe", "link"])
def test_a_pipe_or_device_is_not_replaced(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    with pytest.raises(OSError, match="is a device or a pipe"):
        write_atomically(tmp_path / name, b"new")
    assert (tmp_path / "pipe").is_fifo()
    assert (tmp_path / "link").is_symlink()


def test_a_missing_folder_is_the_systems_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_atomically(tmp_path / "nowhere" / "a.bin", b"new")


def test_the_file_has_the_rights_that_the_umask_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old = os.umask(0o027)
    try:
        # Reading the umask would set it, and other threads would make files that anybody may write.
        monkeypatch.delattr(os, "umask")
        write_atomically(tmp_path / "a.bin", b"new")
    finally:
        monkeypatch.undo()
        os.umask(old)
    assert (tmp_path / "a.bin").stat().st_mode & 0o777 == 0o640


def test_a_file_of_the_limit_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * 10)
    assert read_file(path, 10, SettingError) == b"x" * 10


def test_a_larger_file_is_refused_with_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * 11)
    with pytest.raises(SettingError, match="larger than 10 bytes"):
        read_file(path, 10, SettingError)


def test_a_short_file_takes_little_memory_whatever_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * 3_000_000)
    found = list[bytes]()
    assert peak_bytes(lambda: found.append(read_file(path, 1 << 30, SettingError))) < 9_000_000
    assert found == [b"x" * 3_000_000]


@pytest.mark.parametrize("special", ["/dev/zero", "pipe", "link"])
def test_what_may_never_end_is_refused_unread(tmp_path: Path, special: str) -> None:
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to("/dev/zero")
    with pytest.raises(SettingError, match="device or a pipe"):
        read_file({"pipe": pipe, "link": link}.get(special, Path(special)), 10, SettingError)


def test_a_folder_is_an_os_error_as_open_gives_it(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError) as caught:
        read_file(tmp_path, 10, SettingError)
    assert caught.value.filename == str(tmp_path)
