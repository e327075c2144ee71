from dataclasses import replace
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from thenar.compiler import merge, split
from thenar.compiler.recordings import RecordingError
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.merging import By, split_into
from thenar.compiler.recordings.taxonomy import own, published

from .conftest import grasp_sets

BY = st.sampled_from(["subject", "object", "session"])


def rows_of(grasp_set: GraspSet) -> list[tuple[object, ...]]:
    """Return what each row says, whatever the order of rows and columns, with joints in their units."""
    values = [joint.value(codes) for joint, codes in zip(grasp_set.joints, grasp_set.codes.T, strict=True)]
    inputs = {
        **dict(zip(grasp_set.switch_names, grasp_set.switches.T, strict=True)),
        **dict(zip(grasp_set.joint_names, values, strict=True)),
    }
    who = (grasp_set.grasps, grasp_set.subjects, grasp_set.objects, grasp_set.sessions, grasp_set.trials)
    columns = [*who, *(inputs[name] for name in sorted(inputs))]
    return sorted(zip(*(column.tolist() for column in columns), strict=True))


@given(data=st.data(), by=BY)
def test_the_parts_of_a_set_merge_to_the_same_rows(data: st.DataObject, by: By) -> None:
    grasp_set = data.draw(grasp_sets())
    grasp_set = replace(
        grasp_set, independent=data.draw(st.booleans()), simulated=data.draw(st.sampled_from(["", "x"]))
    )
    parts = split(grasp_set, by)
    assert all({*getattr(part, f"{by}s").tolist()} == {name} for name, part in parts.items())
    merged = merge(parts)
    assert rows_of(merged) == rows_of(grasp_set)
    kept = (merged.taxonomy, merged.joints, merged.switch_names, merged.simulated, merged.independent)
    assert kept == (
        grasp_set.taxonomy, grasp_set.joints, grasp_set.switch_names, grasp_set.simulated, grasp_set.independent
    )  # fmt: skip
    assert merge({"alone": grasp_set}).fingerprint() == grasp_set.fingerprint()


def test_columns_may_come_in_another_order(small: GraspSet) -> None:
    other = replace(
        small,
        switches=small.switches[:, ::-1],
        switch_names=small.switch_names[::-1],
        codes=small.codes[:, ::-1],
        joints=small.joints[::-1],
        subjects=np.full(6, "C"),
    )
    merged = merge({"a": small, "b": other})
    assert merged.rows(range(6)).fingerprint() == small.fingerprint()
    assert merged.rows(range(6, 12)).fingerprint() == replace(small, subjects=np.full(6, "C")).fingerprint()


@pytest.mark.parametrize(("first", "second"), [(0, 40), (40, 0), (3, 3)])
@pytest.mark.parametrize("step", [0.1, -0.5])
def test_merging_shifts_codes_of_another_origin_without_changing_values(
    small: GraspSet, first: int, second: int, step: float
) -> None:
    def imported(origin: int, subject: str) -> GraspSet:
        joint = Joint("index", "deg", 0, origin * step, 1000, origin * step + 1000 * step)
        codes = np.stack([small.codes[:, 0], small.codes[:, 1]], axis=1)
        return replace(small, joints=(joint, small.joints[1]), codes=codes, subjects=np.full(6, subject))

    sets = {"a": imported(first, "A"), "b": imported(second, "B")}
    merged = merge(sets)
    for name, rows in (("a", slice(6)), ("b", slice(6, 12))):
        before = sets[name].joints[0].value(sets[name].codes[:, 0])
        np.testing.assert_allclose(merged.joints[0].value(merged.codes[rows, 0]), before, rtol=0, atol=1e-9)
    assert merged.codes[:, 0].min() == small.codes[:, 0].min()


def test_taxels_are_merged_as_joints_are(small: GraspSet) -> None:
    pads = tuple(Joint(name, "counts", 0, 0.0, 1, 1.0) for name in ("pad 1", "pad 2"))
    one = replace(small, taxels=np.arange(12, dtype=np.uint16).reshape(6, 2), taxel_columns=pads)
    two = replace(one, taxels=one.taxels[:, ::-1], taxel_columns=pads[::-1], subjects=np.full(6, "C"))
    merged = merge({"a": one, "b": two})
    assert merged.taxel_columns == pads
    assert merged.taxels.tolist() == one.taxels.tolist() * 2
    with pytest.raises(RecordingError, match="b lacks 2 taxels that a has: pad 1, pad 2"):
        merge({"a": one, "b": another(small)})
    wide = replace(two, taxel_columns=(pads[1], replace(pads[0], value_b=2.0)))
    with pytest.raises(RecordingError, match="pad 1 is calibrated differently in b and in a"):
        merge({"a": one, "b": wide})


def another(small: GraspSet, **changes: object) -> GraspSet:
    return replace(small, **{"subjects": np.full(6, "C"), **changes})  # type: ignore[arg-type]


INDEX, WRIST = Joint("index", "deg", 0, -10.0, 100, 40.0), Joint("wrist", "deg", 0, 0.0, 1, 0.5)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"switch_names": ("dead", "thumb", "palm", "heel")}, "b.grasps lacks 1 switch that a.grasps has: palm copy"),
        (
            {"switches": np.zeros((6, 2)) > 0, "switch_names": ("dead", "thumb")},
            "b.grasps lacks 2 switches that a.grasps has: palm, palm copy; only sets with the same columns",
        ),
        (
            {"switches": np.zeros((6, 5)) > 0, "switch_names": ("dead", "thumb", "palm", "palm copy", "new")},
            "a.grasps lacks 1 switch that b.grasps has: new",
        ),
        ({"joints": (INDEX, replace(WRIST, name="elbow"))}, "b.grasps lacks 1 joint that a.grasps has: wrist"),
        (
            {"joints": (replace(INDEX, value_a=-10.2, value_b=39.8), WRIST)},
            "index is calibrated differently in b.grasps and in a.grasps: code 0 is -10.2 deg and a step 0.5, not "
            "-10 deg and 0.5",
        ),
        ({"joints": (replace(INDEX, value_b=45.0), WRIST)}, "code 0 is -10 deg and a step 0.55, not -10 deg and 0.5"),
        ({"joints": (replace(INDEX, unit="rad"), WRIST)}, "code 0 is -10 rad"),
        (
            {"joints": (replace(INDEX, value_a=-32790.0, value_b=-32740.0), WRIST)},
            "a.grasps: index gets codes above 65535",
        ),
        ({"taxonomy": own(["PoS", "PoH", "Tip"])}, "taxonomy kamakura14, b.grasps of own: import both with one"),
        ({"taxonomy": published("feix33"), "grasps": np.full(6, "Tripod")}, "taxonomy kamakura14, b.grasps of feix33"),
        ({"independent": True}, 'b.grasps states `frames = "independent"`, a.grasps does not'),
        (
            {"subjects": np.full(6, "A")},
            "4 trials are in a.grasps and in b.grasps, the first of subject A, PoS with mug, session 1, trial 0: if",
        ),
    ],
)
def test_what_does_not_fit_is_said_with_both_names(small: GraspSet, changes: dict[str, object], sentence: str) -> None:
    with pytest.raises(RecordingError) as caught:
        merge({"a.grasps": small, "b.grasps": another(small, **changes)})
    assert sentence in str(caught.value)


def test_the_same_rows_are_refused_twice_unless_each_row_is_a_trial(small: GraspSet) -> None:
    alone = replace(small, independent=True)
    assert len(merge({"a": alone, "b": alone})) == 12


@pytest.mark.parametrize("each", ["subject", "session", "object"])
def test_each_file_can_be_a_subject_a_session_or_an_object(small: GraspSet, each: By) -> None:
    merged = merge({"x/mon.grasps": small, "y/tue.grasps": small}, each)
    names = getattr(merged, f"{each}s").tolist()
    expected = ["mon", "tue"]
    if each == "subject":
        expected = ["mon A", "mon B", "tue A", "tue B"]
    assert sorted(set(names)) == expected
    assert len(np.unique(merged.trial_ids)) == 12
    with pytest.raises(RecordingError, match=r"2 sets have 1 names: x/a.grasps, y/a.grasps: rename some"):
        merge({"x/a.grasps": small, "y/a.grasps": small}, each)


def test_taxonomies_of_the_users_own_are_united_in_order(small: GraspSet) -> None:
    one = another(small, taxonomy=own(["cup", "pen"]), grasps=np.array(["cup", "pen"] * 3))
    two = replace(one, taxonomy=own(["rod", "pen"]), grasps=np.array(["rod", "pen"] * 3), subjects=np.full(6, "D"))
    merged = merge({"a": one, "b": two})
    assert merged.taxonomy == own(["cup", "pen", "rod"])
    assert merged.grasps.tolist() == ["cup", "pen"] * 3 + ["rod", "pen"] * 3


@pytest.mark.parametrize(
    ("origins", "whole"),
    [
        (["", ""], ""),
        (["scene x", "scene x"], "scene x"),
        (["", "scene x"], "recorded grasps; scene x"),
        (["a; b", "b; c"], "a; b; c"),
        (["a", "b", "c", "d", "e", "f"], "a; b; c; d; 2 more"),
    ],
)
def test_what_was_simulated_stays_simulated(small: GraspSet, origins: list[str], whole: str) -> None:
    sets = {
        str(number): replace(small, simulated=origin, subjects=np.full(6, str(number)))
        for number, origin in enumerate(origins)
    }
    assert merge(sets).simulated == whole


def test_a_set_is_parted_by_three_things_only(small: GraspSet) -> None:
    for part in (lambda: split(small, "trial"), lambda: merge({"a": small}, "trial")):  # type: ignore[arg-type]
        with pytest.raises(RecordingError, match="'trial' is not one of subject, object, session"):
            part()


def test_times_and_rows_in_which_nothing_is_held_are_merged(small: GraspSet) -> None:
    timed = replace(small, grasps=np.array(["none", *small.grasps[1:]]), times_us=np.arange(6) * 10_000)
    other = replace(timed, sessions=np.full(6, "2"))
    merged = merge({"a": timed, "b": other})
    assert merged.times_us.tolist() == [*timed.times_us.tolist()] * 2
    assert merged.is_none.tolist() == [True, *[False] * 5] * 2
    frames = replace(other, trials=np.ones(6, np.int64), times_us=np.empty(0, np.int64))
    assert not merge({"a": timed, "b": frames}).times_us.size
    static = replace(frames, trials=np.arange(6), grasps=small.grasps)
    assert merge({"a": timed, "b": static}).times_us.tolist() == [*timed.times_us.tolist(), *[0] * 6]
    assert merge({"a": timed, "b": small.rows([])}).times_us.tolist() == timed.times_us.tolist()


def test_no_set_is_no_merge() -> None:
    with pytest.raises(RecordingError, match="no set to merge"):
        merge({})


def test_files_have_safe_names_and_hold_their_part(small: GraspSet, tmp_path: Path) -> None:
    people = ["a/b", "a b", "A_B", "..", "ä" * 150, "ok"]
    odd = replace(small, subjects=np.array(people))
    files = split_into(odd, "subject", tmp_path / "out")
    assert sorted(path.name for path in files.values()) == sorted(path.name for path in (tmp_path / "out").iterdir())
    assert {name: path.name for name, path in files.items()} == {
        "..": "subject-__.grasps",
        "A_B": "subject-A_B.grasps",
        "a b": "subject-a_b-2.grasps",
        "a/b": "subject-a_b-3.grasps",
        "ok": "subject-ok.grasps",
        "ä" * 150: f"subject-{'_' * 100}.grasps",
    }
    assert all(GraspSet.load(path).subjects.tolist() == [name] for name, path in files.items())


def test_splitting_replaces_files_only_on_request(small: GraspSet, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / "subject-A.grasps").write_text("old")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(RecordingError, match=r"out holds subject-A.grasps: name another folder, or add ``overwrite``"):
        split_into(small, "subject", folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    split_into(small, "subject", folder, overwrite=True)
    assert sorted(path.name for path in folder.iterdir()) == ["notes.txt", "subject-A.grasps", "subject-B.grasps"]
    assert (folder / "notes.txt").read_text() == "mine"
    assert len(GraspSet.load(folder / "subject-A.grasps")) == 4
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
