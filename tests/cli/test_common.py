from pathlib import Path

import click
import pytest

from thenar.cli.common import keep_apart, progress


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


def test_no_progress_is_drawn_into_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("importing") as report:
        report(3, 7)
    assert capsys.readouterr() == ("", "")


def test_one_file_under_two_names_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "link").symlink_to("a")
    keep_apart(Path("a"), None, Path("b"), None)
    for other in (Path("./a"), tmp_path / "a", Path("link")):
        with pytest.raises(click.UsageError, match="is named twice"):
            keep_apart(Path("a"), other)
