from dataclasses import replace
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from thenar.compiler import GraspSet
from thenar.compiler.recordings import RecordingError, check_names
from thenar.compiler.recordings.graspset import Joint

from .conftest import grasp_sets

PAD, PADS = Joint("pad", "N", 0, 0.0, 4095, 20.0), np.array([[0], [4095], [65535], [1], [2], [3]], np.uint16)


def fields(grasp_set: GraspSet) -> dict[str, Any]:
    names = ["switches", "switch_names", "codes", "joints", "grasps", "taxonomy", "subjects", "objects", "trials"]
    names += ["sessions", "independent", "taxels", "taxel_columns"]
    return {name: getattr(grasp_set, name) for name in names}


@given(grasp_set=grasp_sets())
def test_labels_are_the_grasps_numbers_in_the_taxonomy(grasp_set: GraspSet) -> None:
    assert [grasp_set.taxonomy.names[label] for label in grasp_set.labels] == grasp_set.grasps.tolist()
    none = (grasp_set.grasps == "none") & ("none" not in grasp_set.taxonomy.types)
    assert grasp_set.is_none.tolist() == none.tolist()
    held = grasp_set.without_none()
    assert (held is grasp_set) == (not none.any())
    assert held.fingerprint() == grasp_set.rows(~none).fingerprint()
    assert len(grasp_set) == len(grasp_set.labels)


@given(data=st.data())
def test_rows_picks_every_array_alike(data: st.DataObject) -> None:
    grasp_set = data.draw(grasp_sets())
    index = data.draw(st.lists(st.integers(0, len(grasp_set) - 1), max_size=5))
    picked = grasp_set.rows(index)
    for name in ("switches", "codes", "grasps", "subjects", "objects", "sessions", "trials", "labels"):
        assert getattr(picked, name).tolist() == [getattr(grasp_set, name)[row].tolist() for row in index]
    mask = np.zeros(len(grasp_set), bool)
    mask[index] = True
    assert grasp_set.rows(mask).trials.tolist() == grasp_set.trials[sorted(set(index))].tolist()


def test_arrays_have_the_promised_types_and_cannot_be_written(small: GraspSet) -> None:
    kinds = {name: getattr(small, name).dtype.kind for name in ("switches", "codes", "grasps", "trials", "labels")}
    assert kinds == {"switches": "b", "codes": "u", "grasps": "U", "trials": "i", "labels": "i"}
    assert small.codes.dtype == np.uint16
    for name in ("switches", "codes", "grasps", "subjects", "objects", "sessions", "trials", "labels"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(small, name)[0] = getattr(small, name)[1]


def test_what_the_caller_does_to_his_array_does_not_reach_the_set(small: GraspSet) -> None:
    codes = small.codes.copy()
    grasp_set = GraspSet(**fields(small) | {"codes": codes})
    codes[:] = 0
    assert np.array_equal(grasp_set.codes, small.codes)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"switches": np.zeros((6, 3), bool)}, r"switches has shape \(6, 3\), not \(6, 4\)"),
        ({"switches": np.full((6, 4), 2)}, "switches holds numbers that do not fit into bool"),
        ({"codes": np.full((6, 2), 65536)}, "codes holds numbers that do not fit into uint16"),
        ({"codes": np.full((6, 2), -1)}, "codes holds numbers that do not fit into uint16"),
        ({"codes": np.full((6, 2), 0.5)}, "codes holds float64, not uint16"),
        ({"codes": np.full((6, 2), "1")}, "codes holds <U1, not uint16"),
        ({"trials": np.zeros(5, int)}, r"trials has shape \(5,\), not \(6,\)"),
        ({"subjects": np.zeros(6, int)}, "subjects holds int64, not str"),
        ({"objects": np.array(["mug"] * 5 + [""])}, "object '' is empty"),
        ({"grasps": np.array(["PoS"] * 5 + ["Pox"])}, "row 5: 'Pox' is not a type of taxonomy kamakura14"),
        ({"switch_names": ("a", "b", "c", "index")}, "column 'index' occurs twice"),
        (
            {"switch_names": (), "joints": (), "switches": np.zeros((6, 0)), "codes": np.zeros((6, 0))},
            "at least one switch or joint",
        ),
    ],
)
def test_a_set_that_contradicts_itself_is_refused(small: GraspSet, change: dict[str, Any], reason: str) -> None:
    with pytest.raises(RecordingError, match=reason):
        GraspSet(**fields(small) | change)


def test_the_fingerprint_sees_every_field_and_nothing_else(small: GraspSet) -> None:
    assert GraspSet(**fields(small)).fingerprint() == small.fingerprint()
    changes: list[dict[str, Any]] = [
        {name: getattr(small, name)[::-1]} for name in ("switches", "codes", "grasps", "subjects", "trials")
    ]
    changes += [{"objects": np.array(["mug"] * 5 + ["cup"])}, {"switch_names": ("a", "b", "c", "d")}]
    changes += [{"sessions": np.array(["1"] * 5 + ["2"])}, {"independent": True}]
    changes += [{"taxels": PADS, "taxel_columns": (PAD,)}, {"taxels": PADS[::-1], "taxel_columns": (PAD,)}]
    changes += [{"taxels": PADS, "taxel_columns": (replace(PAD, unit="kg"),)}]
    changes += [{"joints": (replace(small.joints[0], value_a=-11.0), small.joints[1])}]
    prints = {GraspSet(**fields(small) | change).fingerprint() for change in changes}
    assert len(prints | {small.fingerprint()}) == len(changes) + 1


def test_taxels_are_columns_beside_the_switches(small: GraspSet) -> None:
    grasp_set = GraspSet(**fields(small) | {"taxels": PADS, "taxel_columns": (PAD,)})
    assert grasp_set.element_names == (*small.switch_names, "pad")
    assert grasp_set.rows([1, 0]).taxels.tolist() == [[4095], [0]]
    assert "4 switches, 1 taxels, 2 joints" in repr(grasp_set)
    alone = {"switch_names": (), "switches": np.zeros((6, 0)), "joints": (), "codes": np.zeros((6, 0))}
    assert GraspSet(**fields(grasp_set) | alone).element_names == ("pad",)
    for change, reason in (
        ({"taxels": PADS[:5]}, r"taxels has shape \(5, 1\), not \(6, 1\)"),
        ({"taxel_columns": (replace(PAD, name="index"),)}, "column 'index' occurs twice"),
    ):
        with pytest.raises(RecordingError, match=reason):
            GraspSet(**fields(grasp_set) | change)


@given(data=st.data())
def test_a_trial_is_subject_type_object_session_and_number(data: st.DataObject) -> None:
    grasp_set = data.draw(grasp_sets())
    grasp_set = grasp_set.rows(data.draw(st.lists(st.integers(0, len(grasp_set) - 1), max_size=20)))
    sessions = np.array([data.draw(st.sampled_from("12")) for _ in range(len(grasp_set))], np.str_)
    grasp_set = GraspSet(**fields(grasp_set) | {"sessions": sessions, "independent": data.draw(st.booleans())})
    each = (grasp_set.subjects, grasp_set.grasps, grasp_set.objects, grasp_set.sessions, grasp_set.trials)
    keys = list(zip(*(column.tolist() for column in each), strict=True))
    number = {key: place for place, key in enumerate(dict.fromkeys(keys))}
    expected = range(len(keys)) if grasp_set.independent else [number[key] for key in keys]
    assert grasp_set.trial_ids.tolist() == list(expected)


def test_format_2_is_written_only_where_needed(small: GraspSet, tmp_path: Path) -> None:
    formats = []
    pads = {"taxels": PADS, "taxel_columns": (PAD,)}
    changes: list[dict[str, Any]] = [{}, {"sessions": np.array(["1"] * 5 + ["2"])}, {"independent": True}, pads]
    for change in changes:
        GraspSet(**fields(small) | change).save(tmp_path / "set.grasps")
        formats.append((tmp_path / "set.grasps").read_bytes()[8])
    assert formats == [1, 2, 2, 2]


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        ((5, 0.0, 5, 1.0), "take two of 0..65535"),
        ((-1, 0.0, 5, 1.0), "take two of 0..65535"),
        ((0, 0.0, 65536, 1.0), "take two of 0..65535"),
        ((0, 1.0, 5, 1.0), "cannot be distinguished"),
        ((0, 1.0, 5, float("nan")), "cannot be distinguished"),
        ((0, -1e308, 1, 1e308), "cannot be distinguished"),
        ((0, -8e307, 65535, 8e307), "cannot be distinguished"),
        ((0, 0.0, 1, 5e-324), "cannot be distinguished"),
        ((0, 0.0, 65535, 1e-296), "cannot be distinguished"),
        ((0, 1e12, 1, 1e12 + 1), "cannot be distinguished"),
    ],
)
def test_a_calibration_that_is_no_line_is_refused(points: tuple[int, float, int, float], reason: str) -> None:
    with pytest.raises(RecordingError, match=reason):
        Joint("index", "deg", *points)


@pytest.mark.parametrize(
    ("name", "reason"),
    [("", "is empty"), (" a", "blank"), ("a\n", "blank"), ("a\tb", "control"), ("\ud800", "control"), ("?", "missing")],
)
def test_a_name_that_a_file_format_would_lose_is_refused(name: str, reason: str) -> None:
    with pytest.raises(RecordingError, match=reason):
        check_names("column", ["fine", name])


def test_ordinary_names_of_any_language_pass() -> None:
    check_names("column", ["thumb 1", "親指", "a,b", "it's", "50 %"])
