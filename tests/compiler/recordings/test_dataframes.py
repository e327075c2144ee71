"""Sets to and from DataFrames. What a user may have done to a frame is done by pandas itself."""

from dataclasses import replace
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pandas as pd
import pytest
from hypothesis import given

from thenar.compiler import ColumnRoles, GraspSet, Joint, from_dataframe, to_dataframe
from thenar.compiler.recordings import RecordingError, TableError
from thenar.compiler.recordings.columns import JointColumns
from thenar.compiler.recordings.taxonomy import own

from .conftest import grasp_sets


@pytest.mark.filterwarnings("ignore:.*may be clocks:UserWarning")  # a joint may be called T
@given(grasp_set=grasp_sets(), codes=st.booleans())
def test_a_set_comes_back_from_its_frame(grasp_set: GraspSet, codes: bool) -> None:
    frame = to_dataframe(grasp_set, codes)
    assert from_dataframe(frame).fingerprint() == grasp_set.fingerprint()
    assert len(frame) == len(grasp_set)


@pytest.mark.parametrize("types", [("none", "a"), ("NONE", "a"), ("None",)])
def test_a_type_that_is_spelt_like_none_stays_a_type(small: GraspSet, types: tuple[str, ...]) -> None:
    named = replace(small, taxonomy=own(types), grasps=np.full(len(small), types[0]))
    assert from_dataframe(to_dataframe(named)).fingerprint() == named.fingerprint()


def test_a_frame_has_the_documented_columns_and_types(small: GraspSet) -> None:
    frame = to_dataframe(small)
    inputs = ["dead", "thumb", "palm", "palm copy", "index", "wrist"]
    assert [*frame.columns] == ["grasp", "subject", "object", "trial", *inputs]
    assert [*frame["grasp"].cat.categories] == [*small.taxonomy.types]
    assert frame["trial"].dtype == np.int64
    assert {frame[name].dtype for name in small.switch_names} == {np.dtype(np.bool_)}
    assert {frame[name].dtype for name in small.joint_names} == {np.dtype(np.float64)}
    assert all(isinstance(name, str) for name in frame["subject"])
    assert frame["index"].tolist() == [-9.5, -9.0, -9.0, -9.5, -8.5, -8.0]
    assert to_dataframe(small, codes=True)["index"].dtype == np.uint16
    pads = replace(
        small, taxels=np.arange(6, dtype=np.uint16).reshape(6, 1), taxel_columns=(Joint("pad", "V", 0, 0.0, 2, 1.0),)
    )
    assert [*to_dataframe(pads).columns][4:] == [*inputs[:4], "pad", *inputs[4:]]
    assert to_dataframe(pads)["pad"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]
    several = to_dataframe(replace(small, sessions=np.array(["1", "2"] * 3)))
    assert several["session"].tolist() == ["1", "2"] * 3
    clash = to_dataframe(replace(small, switch_names=("grasp", "grasp_", "trial", "session")))
    assert [*clash.columns][:4] == ["grasp__", "subject", "object", "trial_"]


def test_rows_that_pandas_picks_and_sorts_are_those_of_the_set(small: GraspSet) -> None:
    frame = to_dataframe(small)
    part = frame.query("subject == 'A'").sort_values("trial", ascending=False)
    assert from_dataframe(part).fingerprint() == small.rows([5, 2, 1, 0]).fingerprint()


def test_any_types_of_a_users_frame_are_read() -> None:
    frame = pd.DataFrame(
        {
            "what": pd.Categorical(["hook", "pinch", "hook"]),
            "who": pd.array([7, 8, 7], dtype="Int64"),
            "n": ["1", "2", "3"],
            "bit": pd.array([True, False, True], dtype="boolean"),
            "number": [1, 0, 0],
            "text": ["True", "0", "1.0"],
            "raw": np.array([3, 200, 65535], np.uint16),
            "angle": pd.array([0.5, 1.0, -0.5], dtype="Float32"),
        },
        index=[10, 20, 30],
    )
    columns = ColumnRoles(
        label="what",
        subject="who",
        trial="n",
        switches=("bit", "number", "text"),
        joints=(JointColumns(("raw",), codes=True), JointColumns(("angle",))),
    )
    found = from_dataframe(frame, columns)
    assert found.subjects.tolist() == ["7", "8", "7"]
    assert found.trials.tolist() == [1, 2, 3]
    assert found.switches.tolist() == [[True, True, True], [False, False, False], [True, False, True]]
    assert found.codes.tolist() == [[3, 2], [200, 3], [65535, 1 - 1]]
    assert [joint.value(code) for joint, code in zip(found.joints[1:], found.codes[:1, 1], strict=True)] == [0.5]
    assert found.taxonomy.types == ("hook", "pinch")


def test_the_columns_may_be_a_file(small: GraspSet, tmp_path: Path) -> None:
    frame = to_dataframe(small)
    text = frame.attrs.pop("thenar")
    (tmp_path / "columns.toml").write_text(text)
    for path in (tmp_path / "columns.toml", str(tmp_path / "columns.toml")):
        assert from_dataframe(frame, path).fingerprint() == small.fingerprint()


def test_what_the_columns_are_is_found_as_an_import_finds_it() -> None:
    frame = pd.DataFrame({"grasp": ["hook", "pinch"] * 6, "subject": list("aabbccddeeff"), "trial": [1] * 12})
    frame["pad 1"], frame["pad 2"] = frame["grasp"] == "hook", frame["grasp"] == "pinch"
    found = from_dataframe(frame)
    assert (found.switch_names, len(found), len({*found.subjects.tolist()})) == (("pad 1", "pad 2"), 12, 6)
    with pytest.raises(TableError, match=r"the DataFrame: .*; say so in `columns`"):
        from_dataframe(frame.drop(columns="trial").assign(subject="a"))


@pytest.mark.parametrize("gone", [np.nan, None, pd.NA])
def test_missing_values_are_missing_whatever_pandas_calls_them(small: GraspSet, gone: object) -> None:
    frame = to_dataframe(small)
    frame["subject"] = frame["subject"].astype(object)
    frame.loc[2, "subject"] = gone
    with pytest.raises(TableError, match=r"the DataFrame: missing .*: 1 cell, row 2 'subject' \(''\)"):
        from_dataframe(frame)
    wrist = to_dataframe(small)
    wrist.loc[4, "wrist"] = np.nan
    with pytest.raises(TableError, match="row 4 'wrist'"):
        from_dataframe(wrist)


@pytest.mark.parametrize(
    ("spoil", "error", "sentence"),
    [
        (lambda frame: frame.iloc[:0], TableError, "the DataFrame has no rows"),
        (lambda frame: frame.rename(columns={"thumb": "palm"}), RecordingError, "column 'palm' occurs twice"),
        (lambda frame: frame.drop(columns="thumb"), TableError, "'thumb' matches no column of the table"),
        (lambda frame: frame.assign(wrist=1j), TableError, "column 'wrist' holds complex numbers"),
        (lambda frame: frame.assign(grasp="Hug"), TableError, "'Hug'"),
        (lambda frame: frame.assign(index=np.inf), TableError, "not finite numbers"),
    ],
)
def test_what_cannot_be_read_is_one_sentence(
    small: GraspSet, spoil: object, error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error) as caught:
        from_dataframe(spoil(to_dataframe(small)))  # type: ignore[operator]
    assert sentence in str(caught.value)
