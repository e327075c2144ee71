from dataclasses import replace

import pytest

from thenar.compiler.recordings import RecordingError
from thenar.compiler.recordings import export as module
from thenar.compiler.recordings.export import draw
from thenar.compiler.recordings.graspset import GraspSet


def parts(grasp_set: GraspSet, switches: int, joints: int) -> GraspSet:
    return replace(
        grasp_set,
        switches=grasp_set.switches[:, :switches],
        switch_names=grasp_set.switch_names[:switches],
        codes=grasp_set.codes[:, :joints],
        joints=grasp_set.joints[:joints],
    )


@pytest.mark.parametrize(("switches", "joints"), [(4, 2), (4, 0), (0, 2), (1, 1)])
def test_a_set_of_switches_of_joints_or_of_both_is_drawn(small: GraspSet, switches: int, joints: int) -> None:
    assert draw(parts(small, switches, joints), "png").startswith(b"\x89PNG")


def test_the_svg_names_types_and_joints_and_is_reproducible(small: GraspSet) -> None:
    picture = draw(small, "svg")
    assert picture == draw(small, "svg")
    for words in ("PoS", "Tip", "palm copy", "wrist", "6 trials of 6 frames"):
        assert f"<!-- {words} -->".encode() in picture


def test_a_set_without_rows_cannot_be_drawn(small: GraspSet) -> None:
    with pytest.raises(RecordingError, match="without rows"):
        draw(small.rows([]), "png")


def test_names_are_drawn_as_they_are_and_cut_when_they_are_long(small: GraspSet) -> None:
    joints = (replace(small.joints[0], name="$x^$ [/b]", unit="$"), replace(small.joints[1], name="w" * 200))
    names = ("親指", "s" * 200, *small.switch_names[2:])
    picture = draw(replace(small, switch_names=names, joints=joints), "svg")
    for words in ("$x^$ [/b]", "w" * 29 + "…", "s" * 29 + "…"):
        assert f"<!-- {words} -->".encode() in picture


def test_of_very_many_joints_the_first_are_drawn_and_the_rest_counted(
    small: GraspSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_DRAWN_JOINTS", 1)
    picture = draw(small, "svg")
    assert b"joint values of the first 1 of 2 joints" in picture
    assert b"<!-- index -->" in picture
    assert b"<!-- wrist -->" not in picture
