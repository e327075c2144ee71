from pathlib import Path

import pytest

from thenar.cli import run

Captured = pytest.CaptureFixture[str]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--methods", "nonsense"), "there is no method 'nonsense'"),
        (("--budget-us", "5", "--rate", "0.5"), "give one of them"),
        (("--rate", "1.5"), "1.5 is not in the range"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(
    set_file: Path, tmp_path: Path, arguments: tuple[str, ...], said: str, capsys: Captured
) -> None:
    assert run(["frontier", str(set_file), "-o", str(tmp_path / "found"), *arguments]) == 2
    complaint = " ".join(capsys.readouterr().err.split())
    assert said in complaint
    assert "Traceback" not in complaint


def test_a_file_is_no_folder_and_is_left_alone(set_file: Path, tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert run(["frontier", str(set_file), "-o", str(tmp_path / "notes.txt")]) == 2
    assert "notes.txt' is a file." in " ".join(capsys.readouterr().err.split())
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_folder_that_holds_other_things_is_left_alone(set_file: Path, tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "found").mkdir()
    (tmp_path / "found" / "notes.txt").write_text("mine")
    assert run(["frontier", str(set_file), "-o", str(tmp_path / "found")]) == 2
    assert "is not empty and holds no frontier: name another folder" in " ".join(capsys.readouterr().err.split())
    assert [path.name for path in (tmp_path / "found").iterdir()] == ["notes.txt"]
