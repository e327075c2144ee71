"""A limit on the size of files stands for the disk that is full: both end a write in the middle."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from thenar.cli import run


@contextmanager
def no_file_beyond(size: int) -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(
    ("command", "written"),
    [
        (("export", "set.grasps", "-o", "new.csv"), "new.csv"),
        (("export", "set.grasps", "-o", "new.csv.gz"), "new.csv.gz"),
        (("export", "set.grasps", "-o", "new.arff"), "new.arff"),
        (("import", "table.csv", "-o", "new.grasps", "--columns", "columns.toml"), "new.grasps"),
        (("place", "set.grasps", "--sensors", "2", "-o", "new.json"), "new.json"),
        (("place", "set.grasps", "--sensors", "2", "--draw", "new.svg"), "new.svg"),
    ],
)
def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(
    command: tuple[str, ...],
    written: str,
    set_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "set.grasps").write_bytes(set_file.read_bytes())
    assert run(["export", "set.grasps", "-o", "table.csv", "--columns", "columns.toml"]) == 0
    assert run(command) == 0
    (tmp_path / written).write_bytes(b"the old one")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    capsys.readouterr()
    with no_file_beyond(100):
        assert run([*command, "--overwrite"]) == 2
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    said = capsys.readouterr().err
    assert said.startswith(f"thenar: {written}: ")
    assert said.count("\n") == 1
