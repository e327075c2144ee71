from dataclasses import replace
from pathlib import Path

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.artifact.documents import Documents
from thenar.simulator.handmaps.handmap import hand_map


def test_one_call_makes_a_build_with_its_report_and_spec(grasp_set: GraspSet, tmp_path: Path) -> None:
    gloved = replace(grasp_set, switch_names=hand_map().names[: len(grasp_set.switch_names)])
    for documents, drawn in ((Documents(), False), (Documents(hand_map(), 180), True)):
        compile_build(gloved, tmp_path / "build", rounds=2, folds=0, documents=documents)
        assert ('id="kept-hand"' in (tmp_path / "build" / "report.html").read_text()) == drawn
        assert (tmp_path / "build" / "spec" / "glove.toml").is_file()
        pattern = tmp_path / "build" / "spec" / "cutting.svg"
        assert pattern.is_file() == drawn
    assert "right hand of 180 mm" in pattern.read_text()
