"""Several tables of the same trials: further columns, facts about trials, segments of a recording."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from thenar.compiler import GraspSet

from .conftest import imported, refused, works

pytestmark = pytest.mark.usefixtures("importing")

POSES = {"power": 60, "hook": 30, "tip": 10}
# Of each recording: the rows in which a segment begins and ends, and its label.
SEGMENTS = [(10, 40, "power"), (50, 70, "hook"), (70, 95, "hook"), (100, 130, "tip")]
ROWS = 140


def trials() -> list[tuple[str, str, int]]:
    return [(subject, label, trial) for subject in ("anna", "ben") for label in POSES for trial in (1, 2, 10)]


def write_trials(joints: str, switches: str, lag_s: float = 0.004) -> pd.DataFrame:
    """Write two files a trial, switches at half the rate in other units; return the rows that they are together."""
    random, parts = np.random.default_rng(1), []
    for subject, label, trial in trials():
        count = int(random.integers(8, 20))
        time = np.arange(count) * 10
        flex = (POSES[label] + random.normal(0, 2, (count, 2))).round(2)
        first = pd.DataFrame({"time_ms": time, "counter": time // 10, "f1": flex[:, 0], "f2": flex[:, 1]})
        half = np.arange(0, count, 2) / 100 + lag_s
        bits = random.integers(0, 2, (len(half), 2))
        second = pd.DataFrame({"t": half.round(4), "counter": np.arange(len(half)), "s1": bits[:, 0], "s2": bits[:, 1]})
        for pattern, table, sign in ((joints, first, ","), (switches, second, ";")):
            path = Path(pattern.format(subject=subject, label=label, trial=trial))
            path.parent.mkdir(parents=True, exist_ok=True)
            table.to_csv(path, index=False, sep=sign)
        last = np.searchsorted(half.round(4), time / 1000, "right") - 1
        parts.append(first.assign(subject=subject, label=label, trial=trial, s1=bits[last, 0], s2=bits[last, 1]))
        parts[-1].loc[last < 0, ["s1", "s2"]] = bits[0]  # the nearest frame of the trial
    return pd.concat(parts)


@pytest.mark.parametrize(
    ("joints", "switches"),
    [
        ("d/{subject}_{label}_{trial}/joints.csv", "d/{subject}_{label}_{trial}/switches.csv"),
        ("d/{label}/{subject}_{trial}.csv", "e/{trial}-{label}-{subject}.tsv"),
        # The first pattern matches the files of the second, too.
        ("d/{subject}_{label}_{trial}.csv", "d/{subject}_{label}_{trial}_switches.csv"),
    ],
)
def test_files_of_one_trial_are_merged_by_time(joints: str, switches: str) -> None:
    rows = write_trials(joints, switches)
    found = imported(joints, switches)
    assert (found.joint_names, found.switch_names) == (("f1", "f2"), ("s1", "s2"))
    order = ["subject", "label", "trial", "time_ms"]
    ours = pd.DataFrame(found.switches.astype(int), columns=["s1", "s2"])
    for place, joint in enumerate(found.joints):
        ours[joint.name] = joint.value(found.codes[:, place]).round(2)
    ours = ours.assign(subject=found.subjects, label=found.grasps, trial=found.trials, time_ms=found.times_us // 1000)
    columns = [*order, "f1", "f2", "s1", "s2"]
    assert np.array_equal(ours.sort_values(order)[columns].to_numpy(), rows.sort_values(order)[columns].to_numpy())


def test_tables_without_a_time_stand_row_by_row() -> None:
    columns = pd.DataFrame({"trial": np.repeat(np.arange(12), 5), "grasp": np.repeat([*POSES] * 4, 5)})
    values = np.random.default_rng(2).integers(0, 2, (60, 3))
    columns.assign(s1=values[:, 0]).to_csv("a.csv", index=False)
    order = np.random.default_rng(3).permutation(12)
    more = pd.DataFrame(values[:, 1:], columns=["s2", "s3"]).assign(trial=columns["trial"])
    shuffled = pd.concat([more[more["trial"] == trial] for trial in order])
    shuffled.to_csv("b.csv", index=False)
    assert imported("a.csv", "b.csv").switches.tolist() == values.astype(bool).tolist()
    # Three tables; and rows stay in their trial.
    shuffled.set_axis(["s4", "s5", "trial"], axis="columns").to_excel("c.xlsx", index=False)
    assert imported("a.csv", "b.csv", "c.xlsx").switches.tolist() == values[:, [0, 1, 2, 1, 2]].astype(bool).tolist()
    shuffled.iloc[1:].to_csv("b.csv", index=False)
    assert "a.csv and b.csv have 5 and 4 rows of the trial with row " in refused("a.csv", "b.csv", "--yes")
    more[more["trial"] != 3].to_csv("b.csv", index=False)
    assert "b.csv has no rows of the trial with row 17\n" in refused("a.csv", "b.csv", "--yes")


def test_a_table_with_a_row_for_each_file_names_it() -> None:
    write_trials("d/S1_{subject}_{label}_{trial}.csv", "e/{subject}_{label}_{trial}.csv")
    names = [f"S1_{subject}_{label}_{trial}" for subject, label, trial in trials()]
    table = pd.DataFrame({"filename": names, "grasp": [label for _, label, _ in trials()]})
    by_path = imported("d/S1_{subject}_{label}_{trial}.csv")
    for end in ("", ".csv"):
        table.assign(filename=table["filename"] + end).to_csv("facts.csv", index=False)
        found = imported("d/S1_{subject}_*_{trial}.csv", "facts.csv")
        assert found.grasps.tolist() == by_path.grasps.tolist()
    table.iloc[:-1].to_csv("facts.csv", index=False)
    said = refused("d/S1_{subject}_*_{trial}.csv", "facts.csv", "--yes")
    assert "facts.csv has no rows of the trial with row 2 of S1_ben_tip_10.csv" in said
    table.assign(filename="else").to_csv("facts.csv", index=False)
    said = refused("d/S1_{subject}_*_{trial}.csv", "facts.csv", "--yes")
    assert "facts.csv has no rows of any trial of d/S1_{subject}_*_{trial}.csv, but of filename else" in said


def test_numbers_of_labels_are_named() -> None:
    """By [labels], also where they are written with decimals; or by a table of names."""
    labels = [number for number in range(3) for _ in range(12)]
    values = np.random.default_rng(4).normal(labels, 0.3).round(2)
    frame = pd.DataFrame({"label": labels, "trial": np.arange(36), "flex": values})
    columns = 'label = "label"\ntrial = "trial"\n[[joints]]\ncolumns = ["flex"]\n[labels]\n'
    Path("columns.toml").write_text(columns + '0 = "none"\n1 = "power"\n2 = "tip"\n')
    for kind in (int, float):
        frame.astype({"label": kind}).to_csv("t.csv", index=False)
        done = works("import", "t.csv", "-o", "set.grasps", "--columns", "columns.toml", "--overwrite")
        assert "entries of [labels]" not in done.stderr
        assert np.unique(GraspSet.load("set.grasps").grasps).tolist() == ["none", "power", "tip"]
    frame.to_csv("t.csv", index=False)
    pd.DataFrame({"label": [0, 1, 2], "name": ["open", "power", "tip"]}).to_csv("names.csv", index=False)
    assert imported("t.csv", "names.csv").taxonomy.types == ("power", "tip")


def test_an_empty_key_is_not_the_trial_0() -> None:
    frame = pd.DataFrame({"label": ["tip", "cup"] * 12, "trial": np.arange(24), "flex": np.arange(24) / 8})
    frame.astype({"trial": str}).replace({"trial": {"7": "00", "0": ""}}).to_csv("t.csv", index=False)
    pd.DataFrame({"trial": np.arange(24), "object": ["ball", "pen"] * 12}).to_csv("facts.csv", index=False)
    assert "facts.csv has no rows of the trial with row 2\n" in refused("t.csv", "facts.csv", "--yes")


def recordings() -> dict[str, pd.DataFrame]:
    """Return two recordings, in each of which the hand closes in SEGMENTS, with clocks that begin elsewhere."""
    random, made = np.random.default_rng(5), {}
    for subject, begin_s in (("anna", 3.0), ("ben", 1_700_000_000.0)):
        pose = np.zeros(ROWS)
        for begin, end, label in SEGMENTS:
            pose[begin:end] = POSES[label]
        flex = (pose[:, None] + random.normal(0, 2, (ROWS, 2))).round(2)
        time = (begin_s + np.arange(ROWS) / 50).round(2)
        made[subject] = pd.DataFrame({"time": time, "f1": flex[:, 0], "f2": flex[:, 1]})
    return made


def segments(counted: str) -> pd.DataFrame:
    rows = []
    for subject, frame in recordings().items():
        time = frame["time"].to_numpy()
        for begin, end, label in SEGMENTS:
            of = {"rows": (begin, end), "s": (begin / 50, end / 50), "ms": (begin * 20, end * 20)}
            of["clock"] = (time[begin], time[end])
            rows.append((subject, *of[counted], label))
    unit = "_ms" if counted == "ms" else ""
    return pd.DataFrame(rows, columns=["subject", f"start{unit}", f"end{unit}", "label"])


def test_segments_in_seconds_rows_and_clock_agree() -> None:
    """Each is a trial, also where one follows another; its rows are those that it names, and others are rest."""
    for subject, frame in recordings().items():
        frame.to_csv(f"{subject}.csv", index=False)
    sets = {}
    for counted in ("rows", "s", "clock", "ms"):
        table = segments(counted)
        table.sample(frac=1, random_state=1).to_csv("segments.csv", index=False)
        found = imported("{subject}.csv", "segments.csv")
        for subject in ("anna", "ben"):
            assert _runs(found.rows(found.subjects == subject)) == SEGMENTS
        assert (len(found), len(np.unique(found.trial_ids[~found.is_none]))) == (2 * ROWS, 2 * len(SEGMENTS))
        sets[counted] = (found.grasps.tolist(), found.trials.tolist(), found.codes.tolist())
    assert all(ours == theirs for ours, theirs in pairwise(sets.values()))
    # A table of segments for each recording.
    Path("segments.csv").unlink()
    for subject, part in segments("s").groupby("subject"):
        Path("parts").mkdir(exist_ok=True)
        part.drop(columns="subject").to_csv(f"parts/{subject}.csv", index=False)
    apart = imported("{subject}.csv", "parts/{subject}.csv")
    assert apart.grasps.tolist() == sets["s"][0]
    assert len(np.unique(apart.trial_ids[~apart.is_none])) == 2 * len(SEGMENTS)


def _runs(found: GraspSet) -> list[tuple[int, int, str]]:
    """Return where rows of one trial begin and end, and their label, of those in which something is held."""
    trial = np.where(found.is_none, -1, found.trial_ids)
    edges = [0, *(np.flatnonzero(np.diff(trial)) + 1).tolist(), len(trial)]
    return [(begin, end, str(found.grasps[begin])) for begin, end in pairwise(edges) if trial[begin] >= 0]


def test_bags_follow_a_table_of_segments(capsys: pytest.CaptureFixture[str]) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, kind = get_typestore(Stores.ROS2_JAZZY), "std_msgs/msg/Float32MultiArray"
    layout = store.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    Path("bags").mkdir()
    random = np.random.default_rng(6)
    rows = ["Trial,Start,End,Grasp\n"]
    for trial, label in enumerate([*POSES] * 3, start=1):
        with Writer(Path(f"bags/trial_{trial:02d}"), version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            topic = writer.add_connection("/flex", kind, typestore=store)
            for row in range(40):
                data = (POSES[label] * (10 <= row < 30) + random.normal(0, 2, 2)).astype(np.float32)
                message = store.serialize_cdr(store.types[kind](layout, data), kind)
                writer.write(topic, 10**18 + row * 20_000_000, message)
        rows.append(f"{trial},0.2,0.6,{label}\n")
    Path("segments.csv").write_text("".join(rows).replace("Trial", "trial"))
    found = imported("bags/trial_{trial}", "segments.csv")
    assert "segments.csv: segments, in seconds from its first row" in capsys.readouterr().out
    assert np.array_equal(found.is_none, np.tile([*[True] * 10, *[False] * 20, *[True] * 10], 9))
    assert found.grasps[~found.is_none].tolist() == np.repeat([*POSES] * 3, 20).tolist()
    assert "bags is a folder: name the pattern of its tables" in refused("bags", "segments.csv", "--yes")
    # A bag alone is a table, and a file next to bags is none of them, nor is a folder with other metadata.
    Path("bags/metadata.yaml").write_text("authors: us\n")
    assert "no column looks like the grasp type" in refused("bags/trial_01", "--yes")
    Path("segments.csv").rename("bags/segments.csv")
    assert imported("bags/trial_{trial}", "bags/segments.csv").fingerprint() == found.fingerprint()


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("0,1\n1,1,hook", "segments.csv row 2 has 2 cells, its header 3"),
        ("1,x,hook", "segments.csv: a segment goes up from start to end, but not in row 2"),
        ("2,1,hook", "segments.csv: a segment goes up from start to end, but not in row 2"),
        ("0,1,hook\n0.5,2,tip", "segments.csv: the segment of row 3 begins in another one"),
        (
            "0,1,hook\n7,8,tip",
            "no row of anna.csv, 0 to 2.78 in seconds from its first row, is in the segment of row 3",
        ),
    ],
)
def test_broken_segments_are_told_in_a_sentence(rows: str, said: str) -> None:
    recordings()["anna"].to_csv("anna.csv", index=False)
    Path("segments.csv").write_text(f"start,end,label\n{rows}\n")
    assert said in refused("anna.csv", "segments.csv", "--yes")


def test_tables_that_do_not_belong_together_are_told() -> None:
    anna, ben = recordings().values()
    names = {"f1": "g1", "f2": "g2"}
    other = anna.rename(columns=names)
    tables = {"anna": anna, "ben": ben.rename(columns=names), "twice": pd.concat([anna] * 2), "other": other}
    tables |= {"segments": segments("rows").drop(columns="subject").iloc[:4], "no": other.replace({"time": 3.0}, "so")}
    for name, table in tables.items():
        table.to_csv(f"{name}.csv", index=False)
    for first, second, said in (
        (
            "anna",
            "twice",
            "anna.csv and twice.csv both have 'f1', 'f2': rename the columns of one; of tables with one tri",
        ),
        ("anna", "ben", "have no time of the trial with row 2 in common: 3 to 5.78 s and 1700000000 to 17000000"),
        ("segments", "anna", "segments.csv is a table of segments: name the recording first, anna.csv"),
        ("twice", "other", "time starts again within a trial: name trials in both"),
        ("anna", "no", "no.csv: 'time' is no time in row 2, by which tables are joined"),
    ):
        assert said in refused(f"{first}.csv", f"{second}.csv", "--yes")
