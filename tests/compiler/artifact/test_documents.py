"""What is written with a build: report.html, spec/, and hand.json with its kept switches, its taxels and its joints."""

import html
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.artifact.documents import Documents
from thenar.compiler.hand import HandShape, load_layout
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.taxonomy import own
from thenar.runtime.hand import HandDrawing, load_hand
from thenar.runtime.manifest import Manifest
from thenar.simulator.handmaps.handmap import hand_map

from ..conftest import make_set

TAGS = re.compile(r"<[^>]*>")


def _compile(grasp_set: GraspSet, build: Path, documents: Documents | None = None, **options: object) -> str:
    """Compile a build with documents; return the words of its report, without styles and scripts."""
    given: dict[str, object] = {"rounds": 3, "folds": 0, **options}
    compile_build(grasp_set, build, documents=documents or Documents(hand_map()), **given)  # type: ignore[arg-type]
    page = re.sub(r"<(style|script)\b.*?</\1>", "", (build / "report.html").read_text(), flags=re.DOTALL)
    return " ".join(html.unescape(TAGS.sub(" ", page)).split())


@pytest.fixture(scope="module")
def gloved(grasp_set: GraspSet) -> GraspSet:
    """Return a set that switches of the shipped glove have recorded."""
    return replace(grasp_set, switch_names=hand_map().names[::11][: len(grasp_set.switch_names)])


def test_one_call_makes_a_build_with_its_report_and_spec(gloved: GraspSet, tmp_path: Path) -> None:
    build = tmp_path / "build"
    for documents, drawn in ((Documents(), False), (Documents(hand_map().scaled(180.0)), True)):
        _compile(gloved, build, documents)
        assert ("positions are not known" not in (build / "report.html").read_text()) == drawn
        assert (build / "spec" / "glove.toml").is_file()
        assert (build / "spec" / "cutting.svg").is_file() == drawn
    assert "right hand of 180 mm" in (build / "spec" / "cutting.svg").read_text()


def test_documents_come_and_go_with_the_builds_they_are_of(gloved: GraspSet, tmp_path: Path) -> None:
    build = tmp_path / "build"
    _compile(gloved, build)
    assert (build / "spec").exists()
    compile_build(gloved, build, rounds=3, folds=0)
    made = sorted(path.name for path in build.iterdir())
    assert made == ["build.json", "ensemble.bin", "firmware", "hand.json", "tables.bin"]
    _compile(gloved, build)
    assert "This build reads no switches or pads." in _compile(gloved, build, inputs="joints")
    assert not (build / "spec").exists()


def test_the_report_has_the_confusion_of_the_builds_own_folds(gloved: GraspSet, tmp_path: Path) -> None:
    words = _compile(gloved, tmp_path / "build", folds=3, seed=5)
    assert re.search(r"This build's recipe \(placement: .*; trainer: .*\), within subject, 3 nested folds", words)
    assert "thenar evaluate SET.grasps prints the paper's tables" in words


@pytest.mark.parametrize(("types", "switches", "joints"), [(2, 1, 0), (2, 0, 1), (33, 12, 2), (33, 6, 0)])
def test_sets_at_the_edges_have_a_report(tmp_path: Path, types: int, switches: int, joints: int) -> None:
    labels, random = np.arange(types * 6) % types, np.random.default_rng(3)
    names = tuple(f"</td><b>type {number} & 握り \u200d" for number in range(types))
    edge = replace(
        make_set(rows=len(labels), types=2, switches=switches, joints=joints),
        switches=(labels[:, None] >> np.arange(switches) & 1).astype(bool),
        switch_names=tuple(f"palm <{number}>" for number in range(switches)),
        codes=(4 * labels[:, None] + random.integers(0, 3, (len(labels), joints))).astype(np.uint16),
        grasps=np.array(names)[labels],
        taxonomy=own(list(names)),
        subjects=np.full(len(labels), "<i>A"),
    )
    assert f"This build recognises {types} grasp types" in _compile(edge, tmp_path / "build", rounds=2, folds=2)
    page = (tmp_path / "build" / "report.html").read_text()
    assert "<b>type" not in page
    assert "<i>A" not in page
    assert (tmp_path / "build" / "spec").exists() == bool(switches)


def _drawn(
    grasp_set: GraspSet, folder: Path, hand: HandShape | None, inputs: str = "both"
) -> tuple[HandDrawing, Manifest]:
    manifest = compile_build(grasp_set, folder, hand=hand, rounds=3, folds=0, inputs=inputs).manifest
    return load_hand(folder, manifest), manifest


def test_switches_are_drawn_in_place_and_kept_ones_are_numbered(gloved: GraspSet, tmp_path: Path) -> None:
    hand, manifest = _drawn(gloved, tmp_path / "build", hand_map())
    assert hand.placed
    assert tuple(each.name for each in hand.switches) == gloved.switch_names
    places = hand_map().by_name
    assert all((each.x_mm, each.y_mm) == pytest.approx(places[each.name], abs=0.051) for each in hand.switches)
    kept = {each.bit: each.name for each in hand.switches if each.bit is not None}
    assert [kept[bit] for bit in range(len(kept))] == [switch.name for switch in manifest.switches]
    assert 0 < len(kept) < len(hand.switches)
    assert (hand.outline[0], hand.outline[-1]) == ((-36.5, -13.0), (36.5, -13.0))
    assert len(hand.strips) == 10
    codes = gloved.codes[:, [joint.column for joint in manifest.joints]]
    ends = [(joint.low, joint.high) for joint in hand.joints]
    assert ends == list(zip((codes.min(axis=0) / 2).tolist(), (codes.max(axis=0) / 2).tolist(), strict=True))


def test_a_layout_draws_a_glove_and_its_taxels(gloved: GraspSet, tmp_path: Path) -> None:
    random = np.random.default_rng(2)
    pressed = np.where(gloved.switches[:, :2], 1500, 200) + random.integers(0, 300, (len(gloved), 2))
    padded = replace(
        gloved,
        switches=gloved.switches[:, 2:5],
        switch_names=("a", "b", "<i>c"),
        taxels=pressed.astype(np.uint16),
        taxel_columns=(Joint("pad>1", "N", 0, 0.0, 4095, 20.0), Joint("pad 2", "N", 0, 0.0, 4095, 20.0)),
    )
    layout = tmp_path / "layout.toml"
    layout.write_text('[places]\na = [0, 1]\nb = [10, 1]\n"<i>c" = [0, 20]\n"pad>1" = [30, 2.25]\n"pad 2" = [9, 9]\n')
    hand, manifest = _drawn(padded, tmp_path / "build", load_layout(layout))
    assert [(each.name, each.x_mm, each.y_mm) for each in hand.switches] == [("a", 0, 1), ("b", 10, 1), ("<i>c", 0, 20)]
    assert [each.name for each in hand.taxels] == ["pad>1", "pad 2"]
    levels = {bit: (code, each.name) for each in hand.taxels for code, bit in each.levels}
    assert levels == {
        bit: (switch.threshold.code, switch.source)
        for bit, switch in enumerate(manifest.switches)
        if switch.threshold is not None
    }
    assert levels


def test_switches_of_nobody_knows_which_glove_stand_in_a_grid(grasp_set: GraspSet, tmp_path: Path) -> None:
    hand, manifest = _drawn(grasp_set, tmp_path / "build", hand_map())
    assert (hand.placed, hand.outline) == (False, ())
    assert [each.name for each in hand.switches] == [switch.name for switch in manifest.switches]


def test_the_drawing_changes_nothing_but_its_own_seal(gloved: GraspSet, tmp_path: Path) -> None:
    _, placed = _drawn(gloved, tmp_path / "placed", hand_map())
    _, grid = _drawn(gloved, tmp_path / "grid", None)
    assert placed.hand_sha256 != grid.hand_sha256
    for name in ("tables.bin", "ensemble.bin"):
        assert (tmp_path / "placed" / name).read_bytes() == (tmp_path / "grid" / name).read_bytes()
