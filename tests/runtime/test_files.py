import os
import subprocess
import sys
from pathlib import Path

import pytest

from thenar.runtime.files import write_atomically


def test_a_file_is_written_and_nothing_beside_it(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a.bin", b"new")
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("a.bin", b"new")]


def test_an_old_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(b"a longer old content")
    write_atomically(tmp_path / "a.bin", b"new")
    assert (tmp_path / "a.bin").read_bytes() == b"new"


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


# Stops where the temporary file is whole and the target not yet replaced.
WRITER = """
import os, signal, sys
from pathlib import Path
from thenar.runtime.files import write_atomically
def stop(descriptor):
    print("there", flush=True)
    sys.stdin.read()
os.fsync = stop
write_atomically(Path(sys.argv[1]), b"theirs")
"""


def test_only_a_dead_writers_leftovers_are_deleted(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    command = [sys.executable, "-c", WRITER, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"there\n"
        write_atomically(path, b"ours")
        assert len(list(tmp_path.iterdir())) == 2
        writer.kill()
    assert len(list(tmp_path.iterdir())) == 2
    foreign = [tmp_path / name for name in (".a.bin.part", ".b.bin.01234567.part", "a.bin.01234567.part")]
    for other in foreign:
        other.write_bytes(b"")
    write_atomically(path, b"new")
    assert sorted(tmp_path.iterdir()) == sorted([path, *foreign])
    assert path.read_bytes() == b"new"
