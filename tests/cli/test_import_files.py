"""Sets with one file per trial: patterns of paths, and folders whose pattern import proposes."""

import json
import os
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from thenar.cli import run
from thenar.compiler import GraspSet

from .conftest import columns_toml, imported, refused, works

pytestmark = pytest.mark.usefixtures("importing")

PATTERN = "data/{label}/{subject}_{trial}.csv"
Trial = tuple[str, str, int, pd.DataFrame]


def trials(frames: int = 6, start: float = 0.0) -> Iterator[Trial]:
    """Yield label, subject, trial and frames of 18 trials, each of which begins at time 0, or goes on from `start`."""
    random = np.random.default_rng(3)
    for number, (label, subject, trial) in enumerate(
        (label, subject, trial)
        for label in ("cup", "pen", "key")
        for subject in ("anna", "ben")
        for trial in (1, 2, 10)
    ):
        base = 20 * len(label) * (label > "kez") + 10 * (label == "key") + random.normal(0, 3, 2)
        values = base + random.normal(0, 0.2, (frames, 2))
        time = start * number + np.arange(frames) / 100
        yield label, subject, trial, pd.DataFrame({"time": time, "f1": values[:, 0], "f2": values[:, 1]}).round(3)


def write(pattern: str = PATTERN, start: float = 0.0, **constant: str) -> list[Path]:
    """Write the trials as files whose paths have the fields of `pattern`."""
    paths = []
    for number, (label, subject, trial, frame) in enumerate(trials(start=start), start=1):
        fields = {"label": label, "subject": subject, "trial": trial, "number": number, "a": f"s{1 + (subject > 'b')}"}
        path = Path(pattern.format(**fields, **constant))
        path.parent.mkdir(parents=True, exist_ok=True)
        frame.to_excel(path, index=False) if path.suffix == ".xlsx" else frame.to_csv(path, index=False)
        paths.append(path)
    return paths


def test_the_fields_of_a_pattern_are_columns() -> None:
    write()
    found = imported(PATTERN)
    tables = [frame.assign(label=label, subject=subject, trial=trial) for label, subject, trial, frame in trials()]
    order = sorted(range(18), key=lambda n: ("cup key pen".index(tables[n]["label"][0]), n))
    pd.concat([tables[number] for number in order]).to_csv("one.csv", index=False)
    one = imported("one.csv")
    for name in ("codes", "labels", "subjects", "trials", "times_us"):
        assert np.array_equal(getattr(found, name), getattr(one, name)), name
    assert found.taxonomy == one.taxonomy


def test_a_folder_proposes_its_pattern(capsys: pytest.CaptureFixture[str]) -> None:
    write()
    for name in ("README.txt", "cup/.DS_Store", "cup/.hidden_1.csv", "cup/notes.csv", "cup/deeper/cup_1.csv", "a.md"):
        Path("data", name).parent.mkdir(exist_ok=True)
        Path("data", name).write_text("lies around\n")
    Path("data/cup/loop").symlink_to("..")
    assert run(["import", "data", "-o", "set.grasps"]) == 2
    said = capsys.readouterr()
    for line in (
        f"18 files as {PATTERN}",
        "label: 3 different, cup, key, pen",
        "subject: 2 different, anna, ben",
        "trial: 3 different, 1, 2, 10",
        "left out: 3 tables of another kind or depth, or with other names",
        "files: 18; 1 tables next to them do not match: notes.csv",
    ):
        assert line in said.out.splitlines()
    again = said.err.rpartition("then run: ")[2]
    assert again == f"thenar import '{PATTERN}' -o set.grasps --columns {columns_toml()}\n"
    assert run(shlex.split(again)[1:]) == 0
    by_hand = GraspSet.load("set.grasps")
    assert imported("data").fingerprint() == by_hand.fingerprint()
    assert len(np.unique(by_hand.trial_ids)) == 18


@pytest.mark.parametrize(
    ("written", "proposed"),
    [
        (PATTERN, PATTERN),
        ("data/{a}/{label}_{trial:02d}.csv", "data/s{subject}/{label}_{trial}.csv"),
        ("data/subject_{subject}_{label}_{trial}.csv", "data/subject_{subject}_{label}_{trial}.csv"),
        ("data/{label}-{a}-T{trial}.csv", "data/{label}-s{subject}-T{trial}.csv"),
        ("data/{label}/{label}_{number}.csv", "data/{label}/{label}_{trial}.csv"),
        ("data/x/{subject} {label} rep{trial}.csv", "data/x/{subject} {label} rep{trial}.csv"),
    ],
)
def test_names_of_many_sets_are_understood(written: str, proposed: str, capsys: pytest.CaptureFixture[str]) -> None:
    for path in write(written):
        # A grasp by its name, where two parts of the path are words.
        path.parent.mkdir(exist_ok=True)
        if "subject} {label" in written or "subject_{subject}" in written:
            path.rename(str(path).replace("cup", "power"))
    found = imported("data")
    assert f"18 files as {proposed}" in capsys.readouterr().out.splitlines()
    assert len(np.unique(found.trial_ids)) == 18
    assert len(found.taxonomy.types) == 3
    assert len({*found.subjects.tolist()}) == (1 if "{number}" in written else 2)


@pytest.mark.parametrize("pattern", ["data/{label}_{subject}_*.csv", "data/{label}_{subject}_{note}.csv"])
def test_each_file_is_a_trial_whatever_its_path_says(pattern: str) -> None:
    """Also where time goes on from file to file."""
    write("data/{label}_{subject}_{trial}.csv", start=1.0)
    found = imported(pattern)
    assert len(np.unique(found.trial_ids)) == 18
    assert 'trial = "file"' in columns_toml().read_text()


def test_numbers_of_trials_in_the_files_are_of_one_file() -> None:
    for subject in ("anna", "ben"):
        for day in (1, 2):
            table = pd.concat([frame.assign(grasp=label, rep=trial) for label, _, trial, frame in trials()])
            table.to_csv(f"{subject}_{day}.csv", index=False)
    found = imported("{subject}_{part}.csv")
    assert len(np.unique(found.trial_ids)) == 2 * 2 * 9
    assert found.joint_names == ("f1", "f2")
    assert 'trial = [\n    "file",\n    "rep",\n]' in columns_toml().read_text()
    assert len(np.unique(imported("{subject}_{session}.csv").sessions)) == 2


def test_spreadsheets_are_read_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    for path in write("{label}/{subject}_{trial}.xlsx"):
        if "2" in path.stem or "10" in path.stem:
            path.unlink()
    assert len(np.unique(imported("{label}/{subject}_{trial}.xlsx").trial_ids)) == 6
    # Some are read by one process; what ends it is one of them, and is named.
    crash = Path("crash")
    crash.write_text(f'#!/bin/sh\ncase "$*" in *pen/ben_1*) kill -SEGV $$;; esac\nexec "{sys.executable}" "$@"\n')
    crash.chmod(0o755)
    with monkeypatch.context() as patch:
        patch.setattr(sys, "executable", str(crash.absolute()))
        said = refused("{label}/{subject}_{trial}.xlsx", "--yes")
        assert said.startswith("thenar: pen/ben_1.xlsx: its reader gave up: the file is damaged")
    Path("pen/ben_1.xlsx").write_bytes(b"PK no spreadsheet")
    assert "pen/ben_1.xlsx: cannot be read as a spreadsheet" in refused("{label}/{subject}_{trial}.xlsx", "--yes")
    Path("cup/anna_7.csv").write_text("f1,f2\n1,2\n")
    assert "matches files of several kinds, .csv, .xlsx: name one" in refused("{label}/{subject}_{trial}.*")


def test_faults_name_the_file_and_the_row(capsys: pytest.CaptureFixture[str]) -> None:
    write()
    path = Path("data/key/ben_2.csv")
    good = path.read_text()
    other = "key/ben_2.csv has other columns than cup/anna_1.csv: it lacks 'f2' and it has 'f3'"
    for bad, said in (
        (good.replace("f2", "f3"), other),
        (good.replace("f1,f2", "f1"), "key/ben_2.csv row 2 has 3 cells, its header 2"),
        ("", "key/ben_2.csv has no rows"),
    ):
        path.write_text(bad)
        assert said in refused(PATTERN, "--yes")
    lines = good.splitlines()
    path.write_text(good)
    imported(PATTERN)
    path.write_text("\n".join([*lines[:3], "0.02,oops,1", *lines[4:]]))
    assert "1 cell, row 4 of key/ben_2.csv 'f1' ('oops')" in refused(PATTERN, "--columns", str(columns_toml()))
    path.write_text("\n".join([*lines[:3], "0.02,,1", *lines[4:]]))
    columns = columns_toml().read_text()
    columns_toml().write_text('missing = "drop"\n' + columns)
    capsys.readouterr()
    done = works("import", PATTERN, "-o", "set.grasps", "--overwrite", "--columns", str(columns_toml()), "--json")
    dropped = json.loads(done.stdout)["warnings"][0]
    assert "row 4 of key/ben_2.csv (columns f1)" in dropped["message"]
    # In the table of all files: six rows each, key/ben is fourth of six, its second trial the eleventh file.
    assert dropped["rows"] == [6 * 10 + 3]


def test_what_is_no_set_of_files_is_said() -> None:
    paths = write()
    assert "no table matches data/{label}/{x}.tsv: next to them are" in refused("data/{label}/{x}.tsv", "--yes")
    assert "data/nowhere: No such file or directory" in refused("data/nowhere/{x}.csv", "--yes")
    assert "is a name in braces, such as {label}" in refused("data/{}/{x}.csv", "--yes")
    assert "has a column 'f1', as the pattern has" in refused("data/{label}/{f1}.csv", "--yes")
    assert "does not exist" in refused("nowhere")
    Path("data/cup/anna_3.csv").symlink_to("anna_1.csv")
    assert "cup/anna_3.csv and cup/anna_1.csv are one file" in refused(PATTERN, "--yes")
    Path("data/cup/anna_3.csv").unlink()
    os.mkfifo("data/cup/anna_3.csv")
    Path("data/cup/anna_4.csv").symlink_to("nowhere")
    assert len(np.unique(imported(PATTERN).trial_ids)) == len(paths)
    Path("empty").mkdir()
    assert "empty holds no tables (.csv, .tsv" in refused("empty", "--yes")
    # A file whose name has braces is a file.
    paths[0].rename("{label}.csv")
    assert "no column looks like the grasp type" in refused("{label}.csv", "--yes")
    two = refused("data/cup/anna_2.csv", "data/cup/ben_2.csv")
    assert "of tables with one trial each, name the pattern of their paths" in two


def test_fields_cannot_leave_the_folder() -> None:
    write()
    Path("other_1.csv").write_text("time,f1,f2\n0,1,2\n")
    assert len(np.unique(imported("data/*/{label}_{trial}.csv").trial_ids)) == 18
    assert "no table matches" in refused("data/{label}{x}_{trial}.csv", "--yes")


def test_a_stream_in_each_file_keeps_its_trials() -> None:
    runs = [("rest", 30), ("cup", 50), ("rest", 40), ("pen", 60), ("rest", 20)] * 2
    labels = [label for label, count in runs for _ in range(count)]
    poses = {"rest": 10, "cup": 80, "pen": 50}
    for subject in ("anna", "ben"):
        rows = [f"{n / 100},{label},{poses[label] + n % 7}.5\n" for n, label in enumerate(labels)]
        Path(f"{subject}.csv").write_text("t,label,bend\n" + "".join(rows))
    found = imported("{subject}.csv")
    assert len(np.unique(found.movement_ids)) == 10
    assert {*found.subjects.tolist()} == {"anna", "ben"}
    assert 'frames = "restart"' in columns_toml().read_text()
