from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from thenar.compiler.evaluation.study import StudyDesign, draw, evaluate
from thenar.compiler.evaluation.tables import draw_matrix
from thenar.runtime.recipe import Recipe

from .conftest import make_grasps


def test_every_composition_and_protocol_has_its_picture(tmp_path: Path) -> None:
    options = StudyDesign(Recipe(trainer="logitboost", rounds=2), repeats=1, tables=("compositions", "pruning"))
    study = evaluate(make_grasps(n_joints=0), options, jobs=1)
    drawn = draw(study, tmp_path / "new" / "folder")
    names = [f"confusion-{protocol}-{name}.png" for protocol in ("paper", "nested") for name in ("V", "VI", "VII")]
    assert [path.name for path in drawn] == names
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in drawn)


def test_numbers_and_colours_are_shares_of_the_true_types_rows() -> None:
    axes = Figure().subplots()
    draw_matrix(axes, ("cup", "pen", "rod"), ((150, 50, 0), (1, 199, 0), (0, 0, 0)))
    (image,) = axes.images
    shares = np.array([[0.75, 0.25, 0.0], [0.005, 0.995, 0.0], [0.0, 0.0, 0.0]])
    assert np.allclose(np.asarray(image.get_array()), shares)
    written = {text.get_position(): text.get_text() for text in axes.texts}
    assert written == {(0, 0): "75", (1, 0): "25", (1, 1): "100"}
