from collections.abc import Callable
from pathlib import Path

from thenar.compiler.evaluation.pictures import draw_confusions
from thenar.compiler.evaluation.study import Options, evaluate
from thenar.compiler.recordings.graspset import GraspSet


def test_every_composition_and_protocol_has_its_picture(make_grasps: Callable[..., GraspSet], tmp_path: Path) -> None:
    options = Options(rounds=2, repeats=1, tables=("compositions", "pruning"))
    study = evaluate(make_grasps(n_joints=0), options, jobs=1)
    drawn = draw_confusions(study, tmp_path / "new" / "folder")
    names = [f"confusion-{protocol}-{name}.png" for protocol in ("paper", "honest") for name in ("V", "VI", "VII")]
    assert [path.name for path in drawn] == names
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in drawn)
