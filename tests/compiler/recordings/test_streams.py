"""Streams of a moving hand with rest between movements: one row a frame, imported with nothing but their header."""

import csv
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from thenar.compiler.movements.streams import in_movements
from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.cells import Column, unit_of_time
from thenar.compiler.recordings.columns import ColumnRoles, JointColumns
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import ImportReport, import_table
from thenar.compiler.recordings.propose import ColumnProposal, propose, propose_file
from thenar.compiler.recordings.table import Table

JOINTS = 18


class Made(NamedTuple):
    """Rows of a table, and what they mean: run by run (subject, label, rows)."""

    header: list[str]
    rows: list[list[Any]]
    runs: list[tuple[str, str, int]]


def stream(
    rest: str = "rest",
    types: tuple[str, ...] = ("cup", "pen", "rod"),
    subjects: tuple[str, ...] = ("A", "B"),
    hz: int = 100,
    per_second: float = 1.0,
    repetitions: int = 2,
    seed: int = 1,
    **more: Any,
) -> Made:
    """A hand that closes to each of `types` and opens again, over and over; raw bytes of a CyberGlove.

    more  columns by name, given as functions of (label, number of the repetition)
    """
    random = np.random.default_rng(seed)
    poses = {rest: np.full(JOINTS, 60.0)} | {name: random.integers(60, 220, JOINTS) for name in types}
    rows: list[list[Any]] = []
    runs: list[tuple[str, str, int]] = []
    for subject in subjects:
        tick, at = int(random.integers(0, 1000)), poses[rest]
        order = [rest, *(name for _ in range(repetitions) for name in (*random.permutation(types).tolist(),))]
        for repetition, name in enumerate([each for grasp in order[1:] for each in (rest, grasp)] + [rest]):
            count = int(random.uniform(0.4, 0.9) * hz)
            runs.append((subject, name, count))
            for _ in range(count):
                at = at + 8 / hz * (poses[name] - at)
                sensors = np.clip(np.rint(at + random.normal(0, 0.7, JOINTS)), 1, 255).astype(int)
                cells = [column(name, repetition // 2 // len(types) + 1) for column in more.values()]
                rows.append([f"{tick / hz * per_second:.10g}", subject, name, *cells, *sensors.tolist()])
                tick += 1
    return Made(["time", "subject", "label", *more, *(f"sensor_{n}" for n in range(JOINTS))], rows, runs)


def written(made: Made, folder: Path) -> Path:
    with (folder / "stream.csv").open("w", newline="") as file:
        csv.writer(file).writerows([made.header, *made.rows])
    return folder / "stream.csv"


def imported(made: Made, folder: Path) -> tuple[ColumnProposal, GraspSet, ImportReport]:
    table, proposal = propose_file(written(made, folder))
    return proposal, *import_table(table, proposal.columns)


def check(made: Made, grasp_set: GraspSet, rest: str) -> None:
    """Every run is a trial, every rest belongs to the movement that it leads to, and nothing is lost."""
    assert len(grasp_set) == len(made.rows)
    truth = ["none" if row[2] == rest else row[2] for row in made.rows]
    assert grasp_set.grasps.tolist() == truth
    sizes = [size for _, _, size in made.runs]
    assert grasp_set.trial_ids.tolist() == np.repeat(np.arange(len(sizes)), sizes).tolist()
    movement, number = list[int](), 0
    for _, label, size in made.runs:
        movement += [number] * size
        number += label != rest
    # The rest at the end of each subject leads nowhere.
    pairs = zip([row[1] for row in made.rows], movement, strict=True)
    movement = [key for key, (_, rows) in enumerate(groupby(pairs)) for _ in rows]
    assert grasp_set.movement_ids.tolist() == movement
    assert in_movements(grasp_set).all()


@pytest.mark.parametrize(
    ("rest", "hz", "per_second"),
    [("rest", 100, 1.0), ("None", 50, 1e3), ("Open hand", 200, 1e6), ("0", 90, 1.0), ("-1", 50, 1.0), ("", 100, 1e3)],
)
def test_a_stream_is_imported_without_knowledge(tmp_path: Path, rest: str, hz: int, per_second: float) -> None:
    made = stream(rest, hz=hz, per_second=per_second)
    proposal, grasp_set, report = imported(made, tmp_path)
    check(made, grasp_set, rest)
    assert proposal.lacks == ""
    assert (report.grasp_types, report.trials, report.subjects) == (3, 26, 2)
    assert np.count_nonzero(grasp_set.is_none) == sum(row[2] == rest for row in made.rows)
    assert grasp_set.taxonomy.types == ("cup", "pen", "rod")
    assert grasp_set.joint_names == tuple(f"sensor_{number}" for number in range(JOINTS))
    times = np.array([float(row[0]) for row in made.rows]) / per_second * 1e6
    assert np.abs(grasp_set.times_us - times).max() <= 1
    # The rest at the end of each subject is a movement without a grasp.
    assert len(np.unique(grasp_set.movement_ids[~grasp_set.is_none])) == 12


@pytest.mark.parametrize("number", [lambda label, n: 0 if label == "0" else n, lambda _, n: n])
def test_numbers_of_repetitions_that_many_rests_share_are_left_out(number: Any, tmp_path: Path) -> None:
    repetition: dict[str, Any] = {
        "restimulus": lambda label, _: label,
        "rerepetition": number,
    }
    made = stream("0", ("1", "2", "3", "7", "10"), stimulus=lambda label, _: label, **repetition)
    named = made._replace(header=["time", "subject", "ignored", *made.header[3:]])
    proposal, grasp_set, _ = imported(named._replace(rows=[[*row[:2], "x", *row[3:]] for row in made.rows]), tmp_path)
    assert (proposal.columns.label, proposal.columns.trial, proposal.columns.frames) == ("restimulus", None, "restart")
    assert {name for role in proposal.roles if role.role == "left out" for name in role.columns} == {
        "ignored",
        "stimulus",
        "rerepetition",
    }
    check(made, grasp_set, "0")


def test_a_number_of_movements_that_rest_shares_is_their_trial(tmp_path: Path) -> None:
    made = stream(trial=lambda _, repetition: repetition)
    number, rows = 0, []
    for before, row in zip([made.rows[0], *made.rows], made.rows, strict=False):
        number += before[2] != "rest" and row[2] == "rest"
        rows.append([*row[:3], number, *row[4:]])
    proposal, grasp_set, _ = imported(made._replace(rows=rows), tmp_path)
    assert (proposal.columns.trial, proposal.columns.frames, proposal.columns.none) == ("trial", None, "rest")
    assert len(np.unique(grasp_set.movement_ids)) == 14


def test_objects_of_the_rest_may_be_empty(tmp_path: Path) -> None:
    made = stream("", object=lambda label, _: "" if not label else f"a {label}")
    proposal, grasp_set, report = imported(made, tmp_path)
    assert proposal.columns.missing == "refuse"
    check(made, grasp_set, "")
    assert sorted(set(grasp_set.objects.tolist())) == ["a cup", "a pen", "a rod"]
    assert not [finding for finding in report.warnings if finding.kind in ("dropped rows", "filled cells")]


@pytest.mark.parametrize("time", [None, "time"])
def test_what_a_columns_toml_says_of_none_is_enough(time: str | None, tmp_path: Path) -> None:
    made = stream("Resting")
    table = propose_file(written(made, tmp_path))[0]
    columns = ColumnRoles(
        "label", subject="subject", time=time, none="resting", joints=(JointColumns(("sensor_*",), codes=True),)
    )
    grasp_set, report = import_table(table, columns)
    check(made, grasp_set, "Resting")
    assert (grasp_set.times_us.size > 0) == (time is not None)
    assert 'a run of rows of one label was taken for a trial: frames = "restart" says so' in report.notes


def test_rows_of_none_that_lie_in_no_runs_say_nothing_of_trials() -> None:
    table = Table("t.csv", {"g": ["a", "none"] * 9, "s": ["0", "1"] * 9}, np.arange(18))
    with pytest.raises(TableError, match="18 rows share subject"):
        import_table(table, ColumnRoles("g", switches=("s",)))


def test_recordings_that_follow_each_other_are_apart_where_time_begins_anew() -> None:
    labels = ["rest"] * 5 + ["a"] * 5 + ["rest"] * 5 + ["b"] * 5
    columns: dict[str, Column] = {"label": labels * 2, "time_s": np.tile(np.arange(20) / 50, 2), "s": ["0", "1"] * 20}
    table = Table("t.csv", columns, np.arange(40))
    proposal = propose(table)
    assert (proposal.columns.frames, proposal.columns.time_unit, proposal.columns.none) == ("restart", "s", "rest")
    grasp_set, _ = import_table(table, proposal.columns)
    assert grasp_set.movement_ids.tolist() == np.repeat(np.arange(4), 10).tolist()
    assert grasp_set.times_us[19:22].tolist() == [380_000, 0, 20_000]


@pytest.mark.parametrize(
    ("labels", "none"),
    [
        (["rest", "a", "b"], "rest"),
        (["Rest_Position", "idle", "a", "b"], ("Rest_Position", "idle")),
        (["No grasp", "a", "b"], "No grasp"),
        (["open", "closed"], ()),
        (["none", "a"], "none"),
        (["0", "1", "2"], ()),
        (["restaurant", "a", "b"], ()),
    ],
)
def test_labels_that_mean_that_nothing_is_held_are_told_by_their_words(
    labels: list[str], none: str | tuple[str, ...]
) -> None:
    table = Table(
        "t.csv",
        {"label": labels * 4, "x": np.random.default_rng(1).random(4 * len(labels))},
        np.arange(4 * len(labels)),
    )
    assert propose(table).columns.none == none


def test_labels_that_nothing_means_are_told_of() -> None:
    table = Table("t.csv", {"g": ["a", "b"], "s": ["0", "1"]}, np.arange(2))
    _, report = import_table(table, ColumnRoles("g", switches=("s",), none=("b", "idle")))
    assert (report.rests, report.grasp_types) == (1, 1)
    assert [finding.message for finding in report.warnings if finding.kind == "unused aliases"] == [
        "1 entries of [labels] and `none` occur in no row: idle"
    ]


def test_a_taxonomy_that_lists_none_takes_it_for_a_type() -> None:
    table = Table("t.csv", {"g": ["a", "none"], "s": ["0", "1"]}, np.arange(2))
    taxonomies: list[Any] = [("a", "none"), {"lab": ("a", "none")}]
    for taxonomy in taxonomies:
        grasp_set, report = import_table(table, ColumnRoles("g", switches=("s",), taxonomy=taxonomy))
        assert (report.rests, report.grasp_types, grasp_set.labels.tolist()) == (0, 2, [0, 1])
    assert import_table(table, ColumnRoles("g", switches=("s",)))[0].labels.tolist() == [0, 1]
    assert import_table(table, ColumnRoles("g", switches=("s",)))[1].rests == 1


@pytest.mark.parametrize(
    ("name", "step", "unit"),
    [
        ("time", 0.01, "s"),
        ("time", 10, "ms"),
        ("time", 10_000, "us"),
        ("stamp", 1e7, "ns"),
        ("t_ms", 0.01, "ms"),
        ("timeUs", 1, "us"),
        ("Zeit [s]", 1, "s"),
        ("frame", 1, None),
        ("time", 0, None),
    ],
)
def test_a_times_unit_follows_from_its_name_or_steps(name: str, step: float, unit: str | None) -> None:
    assert unit_of_time(name, np.tile(step * np.arange(20.0), 2)) == unit


def test_dates_are_times(tmp_path: Path) -> None:
    made = stream()
    start = np.datetime64("2024-03-01T23:59:59.9", "us")
    stamps = [start + np.timedelta64(10_000 * number, "us") for number in range(len(made.rows))]
    rows = [[str(stamp).replace("T", " "), *row[1:]] for stamp, row in zip(stamps, made.rows, strict=True)]
    proposal, grasp_set, _ = imported(made._replace(header=["Timestamp", *made.header[1:]], rows=rows), tmp_path)
    assert (proposal.columns.time, proposal.columns.time_unit) == ("Timestamp", "us")
    assert np.diff(grasp_set.times_us).tolist() == [10_000] * (len(rows) - 1)
    check(made, grasp_set, "rest")


@pytest.mark.parametrize("wrong", ["2024-13-01 10:00:00", "yesterday", "2024-03-01 10:00:00+01:00", "inf"])
def test_what_is_no_time_is_named(wrong: str) -> None:
    table = Table("t.csv", {"g": ["a", "b"], "t": ["2024-03-01 10:00:00", wrong], "s": ["0", "1"]}, np.arange(2))
    with pytest.raises(TableError, match="not finite numbers, or dates with times: 2 cells"):
        import_table(table, ColumnRoles("g", time="t", switches=("s",)))


def test_times_of_no_known_unit_order_frames_and_are_not_kept() -> None:
    columns = {"g": ["a", "a", "b"], "n": ["1", "1", "1"], "s": ["0", "1", "0"]}
    table = Table("t.csv", columns | {"frame": ["2", "1", "3"]}, np.arange(3))
    grasp_set, report = import_table(table, ColumnRoles("g", trial="n", time="frame", switches=("s",)))
    assert grasp_set.switches[:, 0].tolist() == [True, False, False]
    assert grasp_set.times_us.size == 0
    assert report.notes == (
        "frame orders frames, but does not say when they were recorded: its unit is not known (`time_unit`)",
    )
    grasp_set, report = import_table(table, ColumnRoles("g", trial="n", time="frame", time_unit="ms", switches=("s",)))
    assert grasp_set.times_us.tolist() == [1000, 2000, 3000]


def test_a_time_that_is_none_is_refused() -> None:
    table = Table("t.csv", {"g": ["a", "b"], "t": ["1e300", "0"], "s": ["0", "1"]}, np.arange(2))
    with pytest.raises(TableError, match=r"column 't' holds times of more than 100,000 years"):
        import_table(table, ColumnRoles("g", time="t", time_unit="s", switches=("s",)))
