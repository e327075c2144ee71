from dataclasses import replace
from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from thenar.compiler.recordings.columns import Columns, read_columns, select
from thenar.compiler.recordings.export import columns_of, heads_of
from thenar.compiler.recordings.graspset import GraspSet


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("columns")


def read(text: str, folder: Path) -> Columns:
    (folder / "columns.toml").write_text(text, encoding="utf-8")
    return read_columns(folder / "columns.toml")


@given(data=st.data())
@settings(deadline=None)
def test_its_globs_pick_the_sets_columns_in_the_sets_order(
    data: st.DataObject, grasp_sets: st.SearchStrategy[GraspSet], folder: Path
) -> None:
    grasp_set = data.draw(grasp_sets)
    names = [*heads_of(grasp_set), *grasp_set.element_names, *grasp_set.joint_names]
    selection = select(read(columns_of(grasp_set), folder), names)
    assert selection.switches == grasp_set.switch_names
    assert tuple(name for name, _ in selection.joints) == grasp_set.joint_names


@given(data=st.data())
@settings(deadline=None)
def test_heads_are_never_names_of_inputs(data: st.DataObject, grasp_sets: st.SearchStrategy[GraspSet]) -> None:
    grasp_set = data.draw(grasp_sets)
    heads = heads_of(grasp_set)
    inputs = (*grasp_set.element_names, *grasp_set.joint_names)
    assert len({*heads, *inputs}) == 6 + len(inputs)


def test_neighbours_of_one_calibration_share_an_entry(small: GraspSet, tmp_path: Path) -> None:
    index, wrist = small.joints
    assert len(read(columns_of(small), tmp_path).joints) == 2
    alike = GraspSet(
        small.switches,
        small.switch_names,
        small.codes,
        (index, replace(index, name="wrist")),
        small.grasps,
        small.taxonomy,
        small.subjects,
        small.objects,
        small.trials,
    )
    (entry,) = read(columns_of(alike), tmp_path).joints
    assert entry.columns == ("index", wrist.name)
