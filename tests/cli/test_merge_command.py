import json
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from thenar.compiler import GraspSet, merge
from thenar.compiler.recordings.edits import Edit, apply_edits, read_edits, trials_of

from .conftest import refusal, thenar, works


@pytest.fixture
def files(small_set: GraspSet, tmp_path: Path) -> tuple[Path, Path]:
    anna, ben = tmp_path / "anna.grasps", tmp_path / "ben.grasps"
    small_set.save(anna)
    replace(small_set, subjects=np.full(60, "B"), simulated="scene x").save(ben)
    return anna, ben


def test_two_sets_become_one_and_part_again(files: tuple[Path, Path], tmp_path: Path) -> None:
    anna, ben = files
    whole = tmp_path / "all.grasps"
    done = thenar("merge", anna, ben, "-o", whole)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"{whole}: 120 trials of 120 frames from 2 sets; subjects 2, sessions 1" in done.stdout
    assert "simulated: recorded grasps; scene x" in done.stdout
    sets = {str(path): GraspSet.load(path) for path in files}
    assert GraspSet.load(whole).fingerprint() == merge(sets).fingerprint()
    done = thenar("split", whole, "--by", "subject", "-o", tmp_path / "people", "--json")
    assert [(part["name"], part["frames"]) for part in json.loads(done.stdout)] == [("A", 60), ("B", 60)]
    again = {name: GraspSet.load(tmp_path / "people" / f"subject-{name}.grasps") for name in "AB"}
    assert merge(again).fingerprint() == GraspSet.load(whole).fingerprint()
    assert "people holds subject-A.grasps, subject-B.grasps: name another folder, or add --overwrite" in refusal(
        "split", whole, "--by", "subject", "-o", tmp_path / "people"
    )
    assert thenar("split", whole, "--by", "subject", "-o", tmp_path / "people", "--overwrite").returncode == 0


def test_files_of_one_name_of_trials_are_told_apart_by_their_session(files: tuple[Path, Path], tmp_path: Path) -> None:
    GraspSet.load(files[0]).save(tmp_path / "friday.grasps")
    both = (files[0], tmp_path / "friday.grasps", "-o", tmp_path / "all.grasps")
    said = refusal("merge", *both)
    assert "60 trials are in" in said
    assert "add --each session" in said
    assert not (tmp_path / "all.grasps").exists()
    done = thenar("merge", *both, "--each", "session", "--json")
    found = {"output": str(tmp_path / "all.grasps"), "sets": 2, "frames": 120, "trials": 120, "rests": 0}
    assert json.loads(done.stdout) == {**found, "subjects": 1, "sessions": 2}
    assert {*GraspSet.load(tmp_path / "all.grasps").sessions.tolist()} == {"anna", "friday"}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("merge", "{anna}", "{anna}", "-o", "{folder}/all.grasps"), "is named twice"),
        (("merge", "{anna}", "{ben}", "-o", "{anna}"), "already exists: add --overwrite"),
        (("merge", "{anna}", "{ben}", "-o", "{anna}", "--overwrite"), "is named twice"),
        (("split", "{anna}", "--by", "trial", "-o", "{folder}/out"), "'trial' is not one of"),
        (("split", "{anna}", "--by", "subject", "-o", "{folder}/no/such"), "is no folder: make it first"),
        (("split", "{anna}", "--by", "subject", "-o", "{ben}"), "is a file"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(
    files: tuple[Path, Path], tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    filled = [each.format(anna=files[0], ben=files[1], folder=tmp_path) for each in arguments]
    assert sentence in refusal(*filled)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_edits_are_applied_and_what_is_not_there_is_said(files: tuple[Path, Path], tmp_path: Path) -> None:
    recordings = {path: path.read_bytes() for path in files}
    first, second, *_ = trials_of("anna.grasps", GraspSet.load(files[0]))
    log, clean = tmp_path / "edits.jsonl", tmp_path / "clean.grasps"
    edits = [(first, first[3], ""), (second, second[3], "hook"), (("eva.grasps", *first[1:]), first[3], "")]
    lines = [msgspec.json.encode(Edit("2026-11-30T12:00:00+00:00", 1, *of, old, new)) for of, old, new in edits]
    log.write_bytes(b"\n".join(lines) + b'\n{"time"')
    done = works("merge", files[0], files[1], "--edits", log, "-o", clean)
    assert f"warning: {log}: line 4, the last, is damaged, and was ignored" in done.stderr
    assert "of eva.grasps was edited, but is not there" in done.stderr
    expected, _, _ = apply_edits({str(path): GraspSet.load(path) for path in files}, read_edits(log)[0])
    assert len(expected) == 119
    assert GraspSet.load(clean).fingerprint() == expected.fingerprint()
    assert {path: path.read_bytes() for path in files} == recordings
    log.write_text("no edit\n\n")
    done = thenar("merge", *files, "--edits", log, "-o", tmp_path / "other.grasps")
    assert (done.returncode, (tmp_path / "other.grasps").exists()) == (2, False)
    assert f"{log}: line 1 is no edit: " in done.stderr
