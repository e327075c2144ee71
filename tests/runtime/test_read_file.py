import os
from pathlib import Path

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.files import read_file

from ..conftest import peak_bytes


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
