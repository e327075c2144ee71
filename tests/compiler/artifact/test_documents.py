"""What is written with a build: report.html and spec/."""

import html
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.artifact.documents import Documents
from thenar.compiler.recordings.taxonomy import own
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
    for documents, drawn in ((Documents(), False), (Documents(hand_map(), 180), True)):
        _compile(gloved, build, documents)
        assert ('id="kept-hand"' in (build / "report.html").read_text()) == drawn
        assert (build / "spec" / "glove.toml").is_file()
        assert (build / "spec" / "cutting.svg").is_file() == drawn
    assert "right hand of 180 mm" in (build / "spec" / "cutting.svg").read_text()


def test_documents_come_and_go_with_the_builds_they_are_of(gloved: GraspSet, tmp_path: Path) -> None:
    build = tmp_path / "build"
    _compile(gloved, build)
    assert (build / "spec").exists()
    compile_build(gloved, build, rounds=3, folds=0)
    made = sorted(path.name for path in build.iterdir())
    assert made == ["build.json", "ensemble.bin", "firmware", "hand.json", "tables.bin", "try.html"]
    _compile(gloved, build)
    assert "This build reads no switches or pads." in _compile(gloved, build, inputs="joints")
    assert not (build / "spec").exists()


def test_switches_of_nobody_knows_which_glove_have_a_spec_without_a_pattern(
    grasp_set: GraspSet, tmp_path: Path
) -> None:
    assert "The positions of these sensors on the hand are not known" in _compile(grasp_set, tmp_path / "build")
    assert not list((tmp_path / "build" / "spec").glob("cutting.*"))


def test_the_report_has_the_papers_tables_of_the_builds_own_folds(gloved: GraspSet, tmp_path: Path) -> None:
    words = _compile(gloved, tmp_path / "build", folds=3, seed=5)
    assert "Angle + Sel-Co" in words
    assert "3 stratified folds of whole trials, 1 repeat from seed 5; accuracies" in words
    assert re.search(r"This build's recipe \(placement: .*; trainer: .*\), within subject, 3 nested folds", words)


def test_the_report_of_very_many_subjects_has_no_column_for_each(tmp_path: Path) -> None:
    words = _compile(make_set(rows=640, subjects=32), tmp_path / "build", folds=2)
    assert "have a column for each subject: 32 are too many for a page. thenar evaluate SET.grasps" in words


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
