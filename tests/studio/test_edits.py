"""Edits of trials: their log, and what it makes of recordings, by a model that recomputes everything."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.recordings import RecordingError
from thenar.compiler.recordings.edits import TrialId, apply_edits, read_edits, trials_of
from thenar.compiler.recordings.graspset import GraspSet
from thenar.drivers.errors import SettingError
from thenar.simulator.handmaps.handmap import hand_map
from thenar.studio.edits import change, restore, undo
from thenar.studio.project import Project

from ..sets import grasp_set_of

TYPES = ("cup", "pen", "rod")


def recorded(start: int) -> GraspSet:
    """Return 12 trials of two rows, with rows in which nothing is held around each; numbers occur for several types.

    Row r closes the switches of r + `start` in binary: every row of a project can be recognised.
    """
    trial = np.repeat(np.arange(12), 4)
    labels = np.where(np.tile([False, True, True, False], 12), trial % 3, 3)
    rows = np.arange(len(trial))
    columns = {
        "switches": (rows[:, np.newaxis] + start >> np.arange(8)) & 1,
        "subjects": np.where(trial < 6, "A", "B") if not start else np.full(len(trial), "C"),
        "trials": trial // 3,
    }
    # Each movement is a session, so that rows without a grasp belong to a trial.
    return grasp_set_of(TYPES, labels, sessions=np.char.add("s", trial.astype(str)), **columns)


def clashing() -> GraspSet:
    """Return three trials that differ in their types alone."""
    return grasp_set_of(TYPES, np.repeat(np.arange(3), 2), switches=np.eye(6), trials=np.ones(6, int))


def codes(grasp_set: GraspSet) -> list[int]:
    """Return the number that the switches of each row spell."""
    return [int(code) for code in grasp_set.switches @ (1 << np.arange(grasp_set.switches.shape[1]))]


actions = st.lists(
    st.one_of(
        st.tuples(
            st.just("change"), st.sets(st.integers(0, 23), min_size=1, max_size=5), st.sampled_from(["", *TYPES])
        ),
        st.just(("undo", frozenset[int](), "")),
    ),
    max_size=12,
)


@settings(max_examples=60, deadline=None)
@given(actions=actions)
def test_any_edits_are_as_recomputed_from_scratch(
    tmp_path_factory: pytest.TempPathFactory, actions: list[tuple[str, set[int], str]]
) -> None:
    """Types of rows follow a model that keeps every earlier state; the recordings keep their bytes."""
    folder = tmp_path_factory.mktemp("project")
    sets = {"a.grasps": recorded(0), "b.grasps": recorded(48)}
    for name, one in sets.items():
        one.save(folder / name)
    before = {name: (folder / name).read_bytes() for name in sets}
    project = Project(folder, hand_map())
    trials = [trial for name, one in sets.items() for trial in trials_of(name, one) if trial[3] in TYPES]
    state = {trial: trial[3] for trial in trials}
    earlier = list[dict[TrialId, str]]()
    for do, numbers, new in actions:
        chosen = [trials[number] for number in sorted(numbers)]
        possible = bool(earlier) if do == "undo" else any(state[trial] != new for trial in chosen)
        if not possible:
            with pytest.raises(SettingError, match=r"nothing to undo|already"):
                undo(project.edits) if do == "undo" else change(project.edits, chosen, new)
        elif do == "undo":
            undo(project.edits)
            state = earlier.pop()
        else:
            change(project.edits, chosen, new)
            earlier.append(state)
            state = state | dict.fromkeys(chosen, new)
    grasp_set, of_rows, unused = project.recordings()
    assert not unused
    expected = list[tuple[int, str]]()
    for name, one in sets.items():
        for code, session, grasp in zip(codes(one), one.sessions.tolist(), one.grasps.tolist(), strict=True):
            (trial,) = (trial for trial in trials if trial[0] == name and trial[2] == session)
            if state[trial]:
                expected.append((code, state[trial] if grasp in TYPES else "none"))
    assert list(zip(codes(grasp_set), grasp_set.grasps.tolist(), strict=True)) == expected
    assert [trial[2] for trial in of_rows] == grasp_set.sessions.tolist()
    held = {trial for trial in state if state[trial]}
    assert grasp_set.without_none().n_trials == len(held)
    assert {name: (folder / name).read_bytes() for name in sets} == before


def test_a_trial_that_would_become_another_gets_a_free_number(tmp_path: Path) -> None:
    log, one = tmp_path / "edits.jsonl", clashing()
    cup, pen, _ = trials_of("a.grasps", one)
    change(log, [cup, pen], "rod")
    edited, of_rows, unused = apply_edits({"a.grasps": one}, read_edits(log)[0])
    assert (edited.n_trials, unused) == (3, [])
    assert edited.grasps.tolist() == ["rod"] * 6
    assert edited.trials.tolist() == [2, 2, 3, 3, 1, 1]
    assert [trial[3] for trial in of_rows] == one.grasps.tolist()
    # It frees the number that it had.
    change(log, [pen], "cup")
    assert apply_edits({"a.grasps": one}, read_edits(log)[0])[0].trials.tolist() == [2, 2, 1, 1, 1, 1]


def test_a_trial_that_is_recorded_anew_is_as_recorded_and_its_edit_is_not_undone(tmp_path: Path) -> None:
    log, one = tmp_path / "edits.jsonl", replace(clashing(), trials=np.repeat([1, 2, 3], 2))
    cup, pen, _ = trials_of("a.grasps", one)
    other = ("b.grasps", *cup[1:])
    restore(log, "a.grasps", ())
    assert not log.exists()
    for trial, new in ((pen, ""), (other, "rod"), (cup, "pen"), (cup, "rod")):
        change(log, [trial], new)
    restore(log, "a.grasps", {2, 3})
    text = log.read_bytes()
    restore(log, "a.grasps", {2, 3})
    assert log.read_bytes() == text
    latest = {edit.of: edit.new for edit in read_edits(log)[0]}
    assert latest == {cup: "cup", pen: "", other: "rod"}
    # Of the two actions on it none is left to take back.
    for _ in range(2):
        undo(log)
    assert {edit.of: edit.new for edit in read_edits(log)[0]} == {cup: "cup", pen: "pen", other: "cup"}
    with pytest.raises(SettingError, match="nothing to undo"):
        undo(log)


def test_rows_that_are_trials_are_numbered(tmp_path: Path) -> None:
    one = replace(clashing(), independent=True)
    log = tmp_path / "edits.jsonl"
    change(log, [trials_of("a.grasps", one)[3]], "")
    edited = apply_edits({"folder/a.grasps": one}, read_edits(log)[0])[0]
    assert '"trial":4' in log.read_text()
    assert codes(edited) == [1, 2, 4, 16, 32]


def test_edits_that_cannot_be_used_are_said(tmp_path: Path) -> None:
    log, one = tmp_path / "edits.jsonl", clashing()
    cup, pen, rod = trials_of("a.grasps", one)
    change(log, [cup], "spoon")
    change(log, [(*pen[:5], 7)], "")
    change(log, [("gone.grasps", *rod[1:])], "cup")
    edited, _, unused = apply_edits({"a.grasps": one}, read_edits(log)[0])
    assert edited.fingerprint() == one.fingerprint()
    assert unused == [
        "trial 1 of A, thing, cup, session 1 of a.grasps was made spoon, which is not a type of taxonomy own",
        "trial 7 of A, thing, pen, session 1 of a.grasps was edited, but is not there",
        "trial 1 of A, thing, rod, session 1 of gone.grasps was edited, but is not there",
    ]


@pytest.mark.parametrize("left", [1, 20, -1])
def test_a_line_that_a_kill_left_is_named_and_the_next_edit_replaces_it(tmp_path: Path, left: int) -> None:
    log, (cup, pen, rod) = tmp_path / "edits.jsonl", trials_of("a.grasps", clashing())
    change(log, [cup], "pen")
    whole = log.read_bytes()
    change(log, [pen], "rod")
    log.write_bytes(log.read_bytes()[: len(whole) + left] if left > 0 else log.read_bytes()[:-2])
    edits, damaged = read_edits(log)
    assert [edit.of for edit in edits] == [cup]
    assert damaged == f"{log}: line 2, the last, is damaged, and was ignored"
    change(log, [rod], "")
    edits, damaged = read_edits(log)
    assert ([edit.of for edit in edits], damaged) == ([cup, rod], "")
    assert log.read_bytes().startswith(whole)
    # An editor of text may leave out the last line break.
    log.write_bytes(log.read_bytes()[:-1])
    undo(log)
    found = [(edit.of, edit.new, edit.undo) for edit in read_edits(log)[0]]
    assert found == [(cup, "pen", 0), (rod, "", 0), (rod, "rod", 2)]


@settings(max_examples=60)
@given(cut=st.floats(0.0, 1.0))
def test_a_log_that_is_cut_anywhere_has_the_edits_before(tmp_path_factory: pytest.TempPathFactory, cut: float) -> None:
    log, trials = tmp_path_factory.mktemp("cut") / "edits.jsonl", trials_of("a.grasps", clashing())
    for trial, new in zip(trials, ("pen", "rod", ""), strict=True):
        change(log, [trial], new)
    whole, edits = log.read_bytes(), read_edits(log)[0]
    left = whole[: round(cut * len(whole))]
    log.write_bytes(left)
    *before, last = left.split(b"\n")
    found, damaged = read_edits(log)
    # A line without its break is whole, too.
    assert found == edits[: len(before) + last.endswith(b"}")]
    assert bool(damaged) == bool(last and not last.endswith(b"}"))


def test_damage_elsewhere_is_an_error_with_its_line(tmp_path: Path) -> None:
    log, (cup, pen, _) = tmp_path / "edits.jsonl", trials_of("a.grasps", clashing())
    change(log, [cup], "pen")
    change(log, [pen], "rod")
    lines = log.read_text().splitlines()
    for wrong in ("", "{}", lines[0].replace("cup", "\\ud800"), lines[0][:-1] + ',"more":1}'):
        log.write_text(f"{lines[0]}\n{wrong}\n{lines[1]}\n")
        with pytest.raises(RecordingError, match=r"edits\.jsonl: line 2 is no edit"):
            read_edits(log)
        with pytest.raises(RecordingError, match="line 2"):
            undo(log)


def test_an_edit_is_on_the_disk_before_it_is_told(tmp_path: Path) -> None:
    """A process that is killed right afterwards has written it."""
    script = f"""
import os, signal
from pathlib import Path
from thenar.studio.edits import change
change(Path({str(tmp_path / "edits.jsonl")!r}), [("a.grasps", "A", "1", "cup", "thing", 1)], "")
os.kill(os.getpid(), signal.SIGKILL)
"""
    done = subprocess.run([sys.executable, "-c", script], check=False, env=os.environ)
    assert done.returncode < 0
    (edit,), damaged = read_edits(tmp_path / "edits.jsonl")
    assert (edit.of, edit.old, edit.new, damaged) == (("a.grasps", "A", "1", "cup", "thing", 1), "cup", "", "")
