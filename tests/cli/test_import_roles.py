"""What `thenar import` takes the columns of a stranger's table for."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from thenar.cli import run
from thenar.compiler import ColumnRoles, GraspSet, from_dataframe
from thenar.compiler.recordings.columns import JointColumns

from .conftest import refusal, works

Cells = Mapping[str, "list[str] | NDArray[np.generic]"]
# Returns the set that a table becomes, and what was printed to stdout and stderr.
Import = Callable[..., tuple[GraspSet, str, str]]

TYPES, REPETITIONS, FRAMES = ("fist", "hook", "pinch"), 8, 12


@pytest.fixture
def import_cells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Import:
    def imported(cells: Cells, *arguments: str) -> tuple[GraspSet, str, str]:
        pd.DataFrame(cells).to_csv(tmp_path / "table.csv", index=False)
        return import_file(tmp_path / "table.csv", *arguments)

    def import_file(table: Path, *arguments: str) -> tuple[GraspSet, str, str]:
        output = str(tmp_path / "set.grasps")
        assert run(["import", str(table), "-o", output, "--overwrite", *(arguments or ["--yes"])]) == 0
        said = capsys.readouterr()
        return GraspSet.load(output), said.out, said.err

    return lambda table, *arguments: (import_file if isinstance(table, Path) else imported)(table, *arguments)


def inputs(grasp_set: GraspSet) -> tuple[str, ...]:
    return (*grasp_set.switch_names, *(taxel.name for taxel in grasp_set.taxel_columns), *grasp_set.joint_names)


def hand(closing: bool = False, numbered: bool = True, seed: int = 1) -> dict[str, "list[str] | NDArray[np.generic]"]:
    """Return a table of trials in random order, with three noisy sensors of a hand that is closed or closes."""
    random = np.random.default_rng(seed)
    order = random.permutation(np.repeat(np.arange(len(TYPES)), REPETITIONS))
    label = np.repeat(order, FRAMES)
    trial = [int(np.count_nonzero(order[:place] == kind)) + 1 for place, kind in enumerate(order)]
    course = np.tile(np.linspace(0.1, 1, FRAMES), len(order))[:, np.newaxis] if closing else 1.0
    values = random.uniform(200, 900, (len(TYPES), 3))[label] * course + random.normal(0, 4, (len(label), 3))
    cells: dict[str, list[str] | NDArray[np.generic]] = {"grasp": [TYPES[kind] for kind in label]}
    cells |= {"trial": np.repeat(trial, FRAMES)} if numbered else {}
    return cells | {f"f{number}": values[:, number].round(2) for number in range(3)}


def clocks() -> dict[str, NDArray[np.float64]]:
    """Return the clocks and counters of boards and programs for the rows of `hand`, with pauses and jitter."""
    random = np.random.default_rng(2)
    trials = len(TYPES) * REPETITIONS
    steps = random.uniform(15, 25, trials * FRAMES)
    steps[::FRAMES] += random.uniform(300, 3000, trials)
    ms, row = np.cumsum(steps), np.arange(trials * FRAMES)
    return {
        "ms": np.rint(ms),
        "Elapsed_Time_In_Milliseconds": ms.round(5),
        "secs": ms // 1000 + 1_700_000_000,
        "nsecs": np.rint(ms * 1e6) % 1e9,
        "unix_time": 1.7e9 + ms / 1000,
        "seq": (row + 17.0) % 256,
        "counter": 2.0 * row,
        "Nr": row // FRAMES + 1.0,
        "frame": row % FRAMES + 0.0,
    }


NAMES = {
    "ms": ("ms", "millis", "x"),
    "Elapsed_Time_In_Milliseconds": ("Elapsed_Time_In_Milliseconds", "x"),
    "secs": ("secs", "epoch", "x"),
    "nsecs": ("nsecs",),
    "unix_time": ("unix_time", "x"),
    "seq": ("seq", "x"),
    "counter": ("counter", "sample", "x"),
    "Nr": ("Nr", "x"),
    "frame": ("frame", "x"),
}


@pytest.mark.parametrize("closing", [False, True])
@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, names in NAMES.items() for name in names])
def test_a_clock_or_counter_is_no_sensor_whatever_its_name(
    kind: str, name: str, closing: bool, import_cells: Import
) -> None:
    grasp_set, _, warnings = import_cells({name: clocks()[kind], **hand(closing)})
    assert inputs(grasp_set) == ("f0", "f1", "f2")
    assert len(set(grasp_set.trial_ids.tolist())) == len(TYPES) * REPETITIONS
    assert "clocks" not in warnings


def test_of_two_clocks_the_one_with_a_unit_is_the_time(cases: Path, import_cells: Import) -> None:
    grasp_set, said, _ = import_cells(cases / "second_clock_is_joint" / "two_clocks.csv")
    assert inputs(grasp_set) == ("thumb_flex", "index_flex")
    assert grasp_set.times_us[:2].tolist() == [0, 16667]
    assert "Elapsed_Time_In_Milliseconds │ time     │ its name; 360 different; in ms" in said
    assert "it counts the rows" in said


@pytest.mark.parametrize(("table", "expected"), [("close", ("f1", "f2", "f3")), ("oneframe", ("f1", "f2"))])
def test_rising_within_trials_and_being_constant_in_them_is_no_evidence(
    table: str, expected: tuple[str, ...], cases: Path, import_cells: Import
) -> None:
    grasp_set, _, warnings = import_cells(cases / "rising_is_no_clock" / f"{table}.csv")
    assert inputs(grasp_set) == expected
    assert "clocks" not in warnings


def test_a_single_movement_keeps_its_sensors_with_a_warning(import_cells: Import) -> None:
    course = np.linspace(0, 1, 60)
    cells = {"grasp": ["open"] * 20 + ["fist"] * 40, "f0": (500 * course**2).round(1), "f1": (90 * course**3).round(2)}
    grasp_set, _, warnings = import_cells({"t": np.arange(60) / 50, **cells})
    assert inputs(grasp_set) == ("f0", "f1")
    assert "2 inputs may be clocks, counters or trial numbers" in warnings


def test_sensors_that_rise_with_sorted_labels_are_kept_with_a_warning(import_cells: Import) -> None:
    cells = {
        "grasp": [f"g{number}" for number in range(9)],
        "f0": np.arange(9) ** 2 + 3.5,
        "f1": np.arange(9)[::-1] % 4,
    }
    grasp_set, _, warnings = import_cells(cells)
    assert inputs(grasp_set) == ("f0", "f1")
    assert "1 inputs may be clocks, counters or trial numbers, which say nothing about the hand: f0 (" in warnings


def test_a_clock_among_the_inputs_of_a_users_columns_is_named(tmp_path: Path, import_cells: Import) -> None:
    (tmp_path / "mine.toml").write_text(
        'label = "grasp"\ntrial = "trial"\n[[joints]]\ncolumns = ["f?", "x", "nsecs"]\n'
    )
    some = clocks()
    cells = {**hand(), "x": some["unix_time"] - 1.7e9, "nsecs": (some["nsecs"] / 1e6).round()}
    columns = ColumnRoles("grasp", trial="trial", joints=(JointColumns(("f?", "x", "nsecs")),))
    grasp_set, _, warnings = import_cells(cells, "--columns", str(tmp_path / "mine.toml"))
    assert "x" in inputs(grasp_set)
    for words in ("2 inputs may be clocks", "x (it rises from trial to trial", "nsecs (its name"):
        assert words in warnings
    with pytest.warns(UserWarning, match="2 inputs may be clocks"):
        from_dataframe(pd.DataFrame(cells), columns)


@pytest.mark.parametrize("name", ["Nr", "x"])
def test_consecutive_numbers_one_a_trial_are_the_trial(name: str, import_cells: Import) -> None:
    grasp_set, said, _ = import_cells({name: clocks()["Nr"], **hand(numbered=False)})
    assert inputs(grasp_set) == ("f0", "f1", "f2")
    assert grasp_set.trials.tolist() == clocks()["Nr"].tolist()
    assert "consecutive numbers, one for each run of rows; 24 different" in said


def in_blocks(frames: int, seed: int = 1) -> Cells:
    """Return true trials, recorded in blocks of five between which the glove was worn anew: trials of a block agree."""
    random = np.random.default_rng(seed)
    kind, block, trial, _ = np.indices((3, 4, 5, frames)).reshape(4, -1)
    worn, held = random.normal(0, 30, (3, 4, 4)), random.normal(0, 5, (3, 4, 5, 4))
    values = 500 + 60 * kind[:, np.newaxis] + worn[kind, block] + held[kind, block, trial]
    values += random.normal(0, 1, values.shape)
    sensors = {f"f{number}": column.round(1) for number, column in enumerate(values.T)}
    return {"grasp": [TYPES[number] for number in kind], "trial": 5 * block + trial, **sensors}


@pytest.mark.parametrize("frames", [2, 20])
def test_true_trials_in_blocks_are_imported_with_a_warning(frames: int, import_cells: Import) -> None:
    grasp_set, _, warnings = import_cells(in_blocks(frames))
    assert len(set(grasp_set.trial_ids.tolist())) == 60
    assert "warning: trials resemble the trial before: within a subject, grasp type, object and session" in warnings
    assert "name the blocks (`session`)" in warnings


def test_true_trials_of_one_row_in_blocks_are_imported_with_a_warning(import_cells: Import, tmp_path: Path) -> None:
    cells = dict(in_blocks(1))
    grasp_set, _, warnings = import_cells(cells)
    assert len(set(grasp_set.trial_ids.tolist())) == 60
    assert "warning: the rows look like frames of fewer trials: within a subject, grasp type" in warnings
    assert "they count as trials, because column trial numbers them" in warnings
    quick = ("--tables", "compositions", "--repeats", 1, "--rounds", 2, "--jobs", 1)
    evaluated = works("evaluate", tmp_path / "set.grasps", *quick)
    assert "each row counts as a trial" in " ".join(evaluated.stderr.split())
    cells["sample_no"] = cells.pop("trial")
    pd.DataFrame(cells).to_csv(tmp_path / "frames.csv", index=False)
    (tmp_path / "columns.toml").write_text(
        'label = "grasp"\ntrial = "sample_no"\n[[joints]]\ncolumns = ["f*"]\nunit = "counts"\n'
    )
    columns = ("--columns", tmp_path / "columns.toml")
    assert "the rows look like frames of fewer trials" in refusal(
        "import", tmp_path / "frames.csv", "-o", tmp_path / "f.grasps", *columns
    )


def test_pieces_of_trials_are_no_trials(
    tmp_path: Path, import_cells: Import, capsys: pytest.CaptureFixture[str]
) -> None:
    cells = in_blocks(20)
    cells = {**cells, "trial": np.arange(len(cells["grasp"])) // 4}
    with pytest.raises(AssertionError):
        import_cells(cells)
    said = capsys.readouterr().err
    assert "the rows look like frames of fewer trials" in said
    assert 'name the column that numbers whole trials (trial = "..." in columns.toml)' in said
    assert "independent" not in said


def test_what_a_trial_is_is_said_once(tmp_path: Path) -> None:
    pd.DataFrame(hand()).to_csv(tmp_path / "table.csv", index=False)
    (tmp_path / "c.toml").write_text('label = "grasp"\ntrial = "trial"\nframes = "independent"\n')
    table, columns, output = (str(tmp_path / name) for name in ("table.csv", "c.toml", "set.grasps"))
    said = refusal("import", table, "-o", output, "--columns", columns)
    assert "`trial` and `frames` = 'independent' both say what a trial is: leave one out" in said


def test_renamed_columns_of_two_exports_merge(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {name: str(tmp_path / name) for name in ("a.csv", "b.csv", "a.grasps", "b.grasps", "all.grasps", "b.toml")}
    pd.DataFrame(hand()).to_csv(files["a.csv"], index=False)
    pd.DataFrame(hand(seed=2)).rename(columns={"f1": "index_mcp"}).to_csv(files["b.csv"], index=False)
    for name in ("a", "b"):
        assert run(["import", files[f"{name}.csv"], "-o", files[f"{name}.grasps"], "--yes"]) == 0
    merge = ["merge", files["a.grasps"], files["b.grasps"], "-o", files["all.grasps"], "--each", "session"]
    said = refusal(*merge)
    assert "lacks 1 joint that" in said
    assert "f1, and has index_mcp instead; only sets with the same columns are merged" in said
    assert "import its table again with [rename] in the columns.toml" in said
    columns = (tmp_path / "a.columns.toml").read_text()
    Path(files["b.toml"]).write_text(f'{columns}\n[rename]\nindex_mcp = "f1"\n')
    again = ["import", files["b.csv"], "-o", files["b.grasps"], "--columns", files["b.toml"], "--overwrite"]
    assert run(again) == 0
    assert run(merge) == 0
    assert GraspSet.load(files["all.grasps"]).joint_names == ("f0", "f1", "f2")
    for old, new, said in (("indx_mcp", "f1", "has no column 'indx_mcp'"), ("index_mcp", "f0", "'f0' occurs twice")):
        Path(files["b.toml"]).write_text(f'label = "grasp"\n[rename]\n{old} = "{new}"\n')
        capsys.readouterr()
        assert said in refusal(*again)


HEAD, FINGERS = ("thumb", "index", "middle", "ring", "little"), 600


def test_sensors_that_are_alike_have_one_role(import_cells: Import) -> None:
    random = np.random.default_rng(3)
    resting = np.where(random.random(FINGERS) < 0.7, 300, 900) + random.integers(0, 40, FINGERS)
    flex = {finger: random.integers(300, 900, FINGERS) for finger in HEAD}
    cells = {"grasp": [TYPES[row % 3] for row in range(FINGERS)], "trial": np.arange(FINGERS)}
    alike = {**flex, "thumb": resting}
    named = {f"{finger}_mcp": flex[finger] for finger in HEAD} | {"thumb_crossover": resting, "abd_ring": resting[::-1]}
    for inputs_ in (alike, named):
        grasp_set, _, _ = import_cells({**cells, **inputs_})
        assert {*grasp_set.joint_names} == {*inputs_}
    pads = {f"pad_{finger}": resting + number for number, finger in enumerate(HEAD)}
    grasp_set, _, _ = import_cells({**cells, **pads, **{f"flex_{finger}": flex[finger] for finger in HEAD}})
    assert {*grasp_set.taxel_names} == {*pads}


def test_a_label_is_called_by_its_name(cases: Path, import_cells: Import) -> None:
    grasp_set, said, _ = import_cells(cases / "label_number_beats_name" / "rps.csv")
    assert {*grasp_set.grasps.tolist()} == {"rock", "paper", "scissors"}
    assert inputs(grasp_set) == ("s1", "s2", "s3")
    assert "the number of gesture_name" in said


def test_text_that_is_constant_within_trials_is_a_subject_or_session(import_cells: Import) -> None:
    cells = hand()
    rows = np.arange(len(cells["grasp"]))
    who = [("Ada", "Ben", "Cleo", "Dan", "Eva", "Fay")[trial % 6] for trial in rows // FRAMES]
    batch = [("monday", "tuesday")[row // 144] for row in rows]
    side = [("left", "right")[trial % 2] for trial in rows // FRAMES]
    grasp_set, said, _ = import_cells(
        {"Name": who, "batch": batch, "side": side, "note": [f"{row}" for row in rows], **cells}
    )
    assert {*grasp_set.subjects.tolist()} == {*who}
    assert {*grasp_set.sessions.tolist()} == {*batch}
    for words in (
        "text, constant within trials; 6 different: is it the subject?",
        "text, constant within trials; 2 different: is it the session?",
        "text, constant within trials: name it (subject, object, session) if it is one",
    ):
        assert words in said


def test_every_command_counts_trials_grasps_rests_and_frames_alike(tmp_path: Path, import_cells: Import) -> None:
    random = np.random.default_rng(5)
    trial, _ = np.indices((24, 5)).reshape(2, -1)
    kind = np.where(trial % 2, 1 + trial // 2 % 3, 0)
    bend = np.array([5, 30, 55, 80])[kind] + random.normal(0, 2, len(kind)).round(1)
    cells = {"ms": 50 * np.arange(len(kind)), "grasp": [("rest", *TYPES)[number] for number in kind], "bend": bend}
    path, folder = str(tmp_path / "set.grasps"), str(tmp_path)
    _, said, _ = import_cells(cells)
    size = "24 trials (12 grasps, 12 rests) of 120 frames"
    assert f"{path}: {size}, 3 grasp types (own); subjects 1" in said
    assert "rounded to codes" not in said
    for arguments in (
        ("info", path),
        ("export", path, "-o", f"{folder}/again.csv"),
        ("merge", path, "-o", f"{folder}/merged.grasps"),
        ("split", path, "--by", "subject", "-o", f"{folder}/parts"),
    ):
        assert size in works(*arguments).stdout
    quick = ("--folds", "2", "--repeats", "1", "--rounds", "2", "--tables", "compositions", "--baselines", "none")
    done = works("evaluate", path, *quick, "--jobs", "1")
    assert "12 trials of 60 frames, 3 grasp types; 12 rests left out;" in " ".join(done.stdout.split())
