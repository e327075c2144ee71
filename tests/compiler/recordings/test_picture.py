import pytest

from thenar.compiler.recordings.errors import RecordingError
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.picture import draw


def parts(grasp_set: GraspSet, switches: int, joints: int) -> GraspSet:
    return GraspSet(
        grasp_set.switches[:, :switches],
        grasp_set.switch_names[:switches],
        grasp_set.codes[:, :joints],
        grasp_set.joints[:joints],
        grasp_set.grasps,
        grasp_set.taxonomy,
        grasp_set.subjects,
        grasp_set.objects,
        grasp_set.trials,
    )


@pytest.mark.parametrize(("switches", "joints"), [(4, 2), (4, 0), (0, 2), (1, 1)])
def test_a_set_of_switches_of_joints_or_of_both_is_drawn(small: GraspSet, switches: int, joints: int) -> None:
    assert draw(parts(small, switches, joints), "png").startswith(b"\x89PNG")


def test_an_svg_names_grasp_types_and_joints_and_is_the_same_every_time(small: GraspSet) -> None:
    picture = draw(small, "svg")
    assert picture == draw(small, "svg")
    for words in ("PoS", "Tip", "palm copy", "wrist", "6 grasps"):
        assert f"<!-- {words} -->".encode() in picture


def test_a_set_without_rows_cannot_be_drawn(small: GraspSet) -> None:
    with pytest.raises(RecordingError, match="without rows"):
        draw(small.rows([]), "png")
