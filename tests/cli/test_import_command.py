import json
import os
import shlex
from io import StringIO
from pathlib import Path

import pytest

from thenar.cli import run
from thenar.compiler import GraspSet
from thenar.compiler.text import INDEPENDENT
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.recording.session import Collection, CollectionTask, Label, Session
from thenar.runtime.recording.writer import Recorder

from .conftest import refusal, works

TABLE = "label,who,s1,s2,j1\nmug,A,0,0,10.2\nball,A,1,0,20\nmug,B,0,0,30\nball,B,1,0,\n"
COLUMNS = """label = "label"
subject = "who"
switches = ["s*"]
missing = "drop"
[[joints]]
columns = ["j*"]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "table.csv").write_text(TABLE)
    (tmp_path / "columns.toml").write_text(COLUMNS)
    return tmp_path


def thenar_import(folder: Path, *more: str, output: str = "set.grasps") -> int:
    columns = str(folder / "columns.toml")
    return run(["import", str(folder / "table.csv"), "-o", str(folder / output), "--columns", columns, *more])


def test_a_table_becomes_a_set(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert thenar_import(folder) == 0
    grasp_set = GraspSet.load(folder / "set.grasps")
    assert grasp_set.grasps.tolist() == ["mug", "ball", "mug"]
    said = capsys.readouterr()
    assert "3 trials of 3 frames, 2 grasp types (own); subjects 2, objects 1, switches 2, joints 1" in said.out
    assert "j1" in said.out
    assert "warning: 1 switches never change: s2\n" in said.err
    assert (
        "warning: 1 rows with missing values were left out: row 5 (columns j1); so 1 of 4 trials are lost\n" in said.err
    )


def test_json_is_one_document_with_the_warnings_in_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert thenar_import(folder, "--json") == 0
    said = capsys.readouterr()
    report = json.loads(said.out)
    assert (report["frames"], report["grasp_types"], report["coding"][0]["joint"]) == (3, 2, "j1")
    assert [warning["kind"] for warning in report["warnings"]] == [
        "dropped rows",
        "constant switches",
        "grasp types that a subject lacks",
    ]
    assert said.err == ""


def test_the_old_set_stays_when_the_import_fails(folder: Path) -> None:
    assert thenar_import(folder) == 0
    before = (folder / "set.grasps").read_bytes()
    (folder / "table.csv").write_text("label\n")
    assert thenar_import(folder) == 2
    assert (folder / "set.grasps").read_bytes() == before


def test_the_columns_file_is_never_overwritten(folder: Path) -> None:
    columns = (folder / "columns.toml").rename(folder / "c.grasps")
    given = ("import", folder / "table.csv", "-o", columns, "--columns", columns, "--overwrite")
    assert "c.grasps is named twice" in refusal(*given)
    assert columns.read_text() == COLUMNS


def test_a_folder_is_no_file_to_write(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "set.grasps").mkdir()
    assert thenar_import(folder) == 2
    assert "set.grasps' is a directory" in capsys.readouterr().err


GLOVE = "grasp;wer;Versuch;s1;biegung\n" + "".join(
    f"{grasp};{person};T{trial};{bit};{trial},{bit}5\n"
    for grasp in ("mug", "ball")
    for person in ("Käthe", "Jörg")
    for trial in (1, 2, 10)
    for bit in (0, 1)
)


@pytest.fixture
def glove(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a table in the current folder, whose path has a blank in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my glove.csv").write_text(GLOVE, encoding="latin-1")
    return tmp_path


def asked(monkeypatch: pytest.MonkeyPatch, *answers: str) -> None:
    """Let the command see a terminal at which these answers are given."""
    monkeypatch.setattr(os, "isatty", lambda descriptor: True)
    monkeypatch.setattr("sys.stdin", StringIO("".join(f"{answer}\n" for answer in answers)))


def test_a_table_is_imported_without_a_columns_toml(glove: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["import", "my glove.csv", "-o", "set.grasps", "--yes"]) == 0
    said = capsys.readouterr()
    grasp_set = GraspSet.load("set.grasps")
    assert sorted(set(grasp_set.subjects.tolist())) == ["Jörg", "Käthe"]
    for words in (
        "encoding cp1252",
        "a semicolon",
        "decimal sign: a comma",
        "Versuch │ trial",
        "set.columns.toml: the detected columns",
    ):
        assert words in said.out
    assert "numbered as trials in natural order: 'T1' is 1, 'T2' is 2, 'T10' is 3" in said.out
    assert "12 trials of 24 frames, 2 grasp types (own); subjects 2, objects 1, switches 1, joints 1" in said.out
    # What was written imports the same set; a second time it is there already.
    assert run(["import", "my glove.csv", "-o", "again.grasps", "--columns", "set.columns.toml"]) == 0
    assert (glove / "again.grasps").read_bytes() == (glove / "set.grasps").read_bytes()
    capsys.readouterr()
    (glove / "set.grasps").unlink()
    assert run(["import", "my glove.csv", "-o", "set.grasps", "--yes", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["trials"] == 12
    assert said.err == "set.columns.toml: the detected columns\n"
    assert sorted(path.name for path in glove.glob("*.toml")) == ["set.columns.toml"]
    # Another table does not replace them, unless it may.
    (glove / "other.csv").write_text("grasp,trial,s1,s2\nmug,1,0,1\nball,2,1,0\n")
    (glove / "set.grasps").unlink()
    assert run(["import", "other.csv", "-o", "set.grasps", "--yes"]) == 2
    refused = "set.columns.toml holds other columns than those detected: add --columns set.columns.toml or --overwrite"
    assert refused in capsys.readouterr().err
    assert run(["import", "other.csv", "-o", "set.grasps", "--yes", "--overwrite"]) == 0
    assert "s2" in (glove / "set.columns.toml").read_text()
    assert sorted(path.name for path in glove.glob("*.toml")) == ["set.columns.toml"]


def test_a_stream_with_rest_is_imported_as_it_comes(tmp_path: Path) -> None:
    runs = [("rest", 30), ("cup", 50), ("rest", 40), ("pen", 60), ("rest", 20)] * 2
    labels = [label for label, count in runs for _ in range(count)]
    poses = {"rest": 10, "cup": 80, "pen": 50}
    rows = [f"{n / 100},{label},{poses[label] + n % 7}.5\n" for n, label in enumerate(labels)]
    (tmp_path / "stream.csv").write_text("t,label,bend\n" + "".join(rows))
    said = works("import", tmp_path / "stream.csv", "-o", tmp_path / "set.grasps", "--yes").stdout
    assert "nothing is held where the label is 'rest' (45% of the rows): see `none`" in said
    assert "9 trials (4 grasps, 5 rests) of 400 frames, 2 grasp types (own); subjects 1" in said
    assert 'none = "rest"' in (tmp_path / "set.columns.toml").read_text()
    grasp_set = GraspSet.load(tmp_path / "set.grasps")
    assert grasp_set.times_us[-1] == 3_990_000
    assert len(set(grasp_set.movement_ids.tolist())) == 5


def test_stream_is_of_recordings(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert thenar_import(folder, "--stream") == 2
    assert "--stream is for recordings (.mcap), leave it out" in capsys.readouterr().err
    assert not (folder / "set.grasps").exists()


def test_without_a_terminal_nothing_is_imported_and_the_next_command_is_said(
    glove: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "isatty", lambda descriptor: False)
    assert run(["import", "my glove.csv", "-o", "set.grasps"]) == 2
    said = capsys.readouterr()
    assert "Versuch │ trial" in said.out
    again = "thenar import 'my glove.csv' -o set.grasps --columns set.columns.toml\n"
    assert said.err == f"thenar: nobody confirmed the columns on a terminal: review set.columns.toml, then run: {again}"
    assert not (glove / "set.grasps").exists()
    assert run(shlex.split(again)[1:]) == 0


def test_on_a_terminal_it_asks(
    glove: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked(monkeypatch, "n")
    assert run(["import", "my glove.csv", "-o", "set.grasps"]) == 2
    assert "thenar: nothing was imported: correct set.columns.toml, then run: thenar import" in capsys.readouterr().err
    assert not (glove / "set.grasps").exists()
    asked(monkeypatch, "y")
    assert run(["import", "my glove.csv", "-o", "set.grasps"]) == 0
    assert (glove / "set.grasps").exists()


def test_who_states_that_rows_are_independent_is_asked_for_it(
    glove: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (glove / "rows.csv").write_text("grasp,s1\n" + "mug,0\nball,1\nmug,1\n" * 3)
    assert run(["import", "rows.csv", "-o", "set.grasps", "--yes"]) == 2
    said = capsys.readouterr().err
    assert "no column tells which rows are frames of one trial: name it (trial = ...), or state that each row" in said
    assert "TO DO: no column tells" in (glove / "set.columns.toml").read_text()
    asked(monkeypatch, "y", "n")
    assert run(["import", "rows.csv", "-o", "set.grasps"]) == 2
    assert "TO DO: no column tells" in (glove / "set.columns.toml").read_text()
    asked(monkeypatch, "y", "y", "y")
    assert run(["import", "rows.csv", "-o", "set.grasps"]) == 0
    assert GraspSet.load("set.grasps").independent
    assert run(["compile", "set.grasps", "-o", "build", "--folds", "0", "--rounds", "2"]) == 0
    capsys.readouterr()
    for line in (["info", "set.grasps"], ["verify", "build", "set.grasps"]):
        assert INDEPENDENT in works(*line).stdout.splitlines()
    assert 'frames = "independent"' in (glove / "set.columns.toml").read_text()
    asked(monkeypatch, "n")
    assert run(["import", "rows.csv", "-o", "no.grasps"]) == 2
    assert not (glove / "no.grasps").exists()


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    types = ("cup", "pen")
    tasks = tuple(CollectionTask(grasp, ("thing",)) for grasp in types)
    session = Session(
        thenar="1", switches=("s1", "s2"), sensors=(), collection=Collection("A", "own", types, tasks, 1, 0)
    )
    with Recorder(tmp_path / "a.mcap", session) as recorder:
        for trial, grasp in enumerate(types, start=1):
            recorder.frame(SwitchFrame(trial, trial))
            recorder.label(Label(trial, "captured", trial, grasp, "A", "thing"))
            recorder.label(Label(trial, "accepted", trial, grasp, "A", "thing"))
    return recorder.path


def test_a_recording_needs_no_columns(recording: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = folder / "set.grasps"
    assert run(["import", str(recording), "-o", str(output)]) == 0
    assert GraspSet.load(output).grasps.tolist() == ["cup", "pen"]
    assert (
        "2 trials of 2 frames, 2 grasp types (own); subjects 1, objects 1, switches 2, joints 0"
        in capsys.readouterr().out
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("a.mcap", "--columns", "columns.toml"), "leave columns.toml out"),
        (("table.csv", "a.mcap", "--columns", "columns.toml"), "import the original, without tables"),
        (("a.mcap", "a.mcap"), "a.mcap is named twice"),
        ((), "Missing argument 'TABLE'"),
    ],
)
def test_what_cannot_be_imported_together_is_told(
    recording: Path, folder: Path, arguments: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert said in refusal("import", *arguments, "-o", "set.grasps")
