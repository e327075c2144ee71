import os
from pathlib import Path

import click
import pytest

from thenar.cli.parameters import OutputFile, keep_apart
from thenar.cli.printing import progress


def test_progress_is_drawn_on_a_terminal_with_the_name_as_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    with progress("importing [/x][red].csv") as report:
        report(3, 7)
    said = capsys.readouterr()
    assert "importing [/x][red].csv" in said.err
    assert "3/7" in said.err
    assert said.out == ""


def test_one_file_under_two_names_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "link").symlink_to("a")
    keep_apart(Path("a"), None, Path("b"), None)
    for other in (Path("./a"), tmp_path / "a", Path("link")):
        with pytest.raises(click.UsageError, match="is named twice"):
            keep_apart(Path("a"), other)


def test_a_pipe_or_device_as_output_is_refused_before_work(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(click.BadParameter, match="is a device or a pipe: name a file"):
        OutputFile("pipe").convert(str(tmp_path / "pipe"), None, None)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_refused_before_any_work(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(click.BadParameter, match="is not writable"):
        OutputFile(".grasps").convert(str(tmp_path / "set.grasps"), None, None)
