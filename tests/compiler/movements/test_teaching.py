"""The consensus of demonstrations: alignment, steps, and what is written of them."""

from itertools import permutations
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.artifact.teaching import (
    DemonstratedGrasp,
    Demonstration,
    Task,
    aligned,
    behaviour_tree,
    demonstrations,
    task_json,
    taught,
)
from thenar.compiler.movements.segments import levenshtein
from thenar.compiler.movements.transitions import Transitions
from thenar.compiler.recordings import RecordingError
from thenar.runtime import Build
from thenar.runtime.preshape import PreshapeTable
from thenar.runtime.published import Preshape

from .conftest import make_movements

STRINGS = st.lists(st.text("abcd", max_size=6), min_size=1, max_size=5)


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("teaching") / "build"
    return compile_build(make_movements(), folder, rounds=5, folds=0).folder


def demo(name: str, types: str, held_s: float = 1.0, bend: float = 30.0) -> Demonstration:
    names = {"p": "pinch", "h": "hook", "f": "fist"}
    return Demonstration(name, tuple(DemonstratedGrasp(names[each], held_s, (bend,)) for each in types))


@given(STRINGS)
def test_alignment_keeps_every_item_in_order_without_empty_columns(strings: list[str]) -> None:
    columns = aligned(strings)
    for number, string in enumerate(strings):
        assert [column[number] for column in columns if column[number] is not None] == list(range(len(string)))
    assert all(any(at is not None for at in column) for column in columns)
    assert columns == aligned(strings)


@given(st.text("abc", max_size=7), st.text("abc", max_size=7))
def test_two_sequences_are_aligned_at_their_edit_distance(one: str, other: str) -> None:
    differ = sum(a is None or b is None or one[a] != other[b] for a, b in aligned([one, other]))
    assert differ == levenshtein(list(map(ord, one)), list(map(ord, other)))


def test_what_most_show_is_a_step_whatever_the_order_of_the_demonstrations(build: Path) -> None:
    shown = [demo("1", "pfh"), demo("2", "pfph"), demo("3", "fh"), demo("4", "phfh"), demo("5", "pfh")]
    for order in permutations(shown):
        task = taught(Build.load(build), order, "t")
        assert [(step.grasp, step.shown) for step in task.steps] == [("pinch", 4), ("fist", 5), ("hook", 5)]
    assert task.first == ("pinch", "fist")
    assert [step.then for step in task.steps] == [("fist", "hook"), ("hook", "pinch"), ()]


def test_a_step_has_medians_limit_preshape_and_frequent_successors(build: Path) -> None:
    shown = [demo("1", "ph", 1.0, 10.0), demo("2", "ph", 3.0, 20.0), demo("3", "ph", 1.5, 60.0)]
    shape = Preshape("narrow", ("finger",), (1.0,), 0.5)
    graph = Transitions.of([("pinch", "fist")] * 3 + [("pinch", "hook")], ("pinch", "hook", "fist"))
    task = taught(Build.load(build), shown, "t", PreshapeTable("Gripper", {"pinch": shape}), graph)
    first, last = task.steps
    assert (first.median_s, first.spread_s, first.limit_s) == (1.5, 0.5, 6.0)
    assert (first.joints, task.units) == ({"bend": 20.0}, {"bend": "deg"})
    assert (first.preshape, last.preshape, task.preshapes) == ("narrow", None, "Gripper")
    assert (first.then, last.then) == (("hook", "fist"), ())


def test_demonstrations_with_nothing_in_common_teach_nothing(build: Path) -> None:
    with pytest.raises(RecordingError, match=r"have no grasp that occurs in most of them: 1: pinch; 2: hook"):
        taught(Build.load(build), [demo("1", "p"), demo("2", "h"), demo("3", "f")], "t")


def test_a_task_survives_its_file_and_each_step_is_an_action(build: Path) -> None:
    task = taught(Build.load(build), [demo("1", "phf"), demo("2", "phf")], "pour <tea>")
    assert task == msgspec.json.decode(task_json(task), type=Task)
    root = ElementTree.fromstring(behaviour_tree(task))
    assert (root.tag, root.attrib) == ("root", {"BTCPP_format": "4", "main_tree_to_execute": "task"})
    tree, model = root
    assert (tree.tag, tree.attrib, model.tag) == ("BehaviorTree", {"ID": "task"}, "TreeNodesModel")
    (sequence,) = tree
    assert (sequence.tag, sequence.attrib) == ("Sequence", {"name": "pour <tea>"})
    ports = {port.attrib["name"] for port in model[0]}
    assert model[0].attrib == {"ID": "Grasp"}
    assert {port.tag for port in model[0]} == {"input_port"}
    for action, step in zip(sequence, task.steps, strict=True):
        assert (action.tag, action.attrib["ID"], action.attrib["grasp"]) == ("Action", "Grasp", step.grasp)
        assert action.attrib.keys() - {"ID", "name"} == ports
        assert action.attrib["joints"] == "bend=30"


def test_each_stream_is_a_demonstration_with_its_joint_values(build: Path, tmp_path: Path) -> None:
    grasp_set = make_movements("CD", 2, seed=5)
    grasp_set.save(tmp_path / "demos.grasps")
    shown = list(demonstrations(build, [tmp_path / "demos.grasps"]))
    assert [one.name for one in shown] == ["demos.grasps 1 (C)", "demos.grasps 2 (D)"]
    for subject, one in zip("CD", shown, strict=True):
        own = grasp_set.rows(grasp_set.subjects == subject)
        starts = np.flatnonzero(np.diff(own.labels, prepend=-1))
        assert list(one.types) == [name for name in own.grasps[starts].tolist() if name != "none"]
        for each in one.grasps:
            assert 0.2 <= each.held_s <= 0.45
            rows = own.grasps == each.grasp
            assert each.joints[0] == pytest.approx(float(np.median(own.codes[rows])) * 90 / 255, abs=2)
