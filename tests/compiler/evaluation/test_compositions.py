import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.evaluation.compositions import COMPOSITIONS, Composition, available

PAPER = {
    "I": ("Angle + All-Co", (0, 1, 2, 3, 4, 5)),
    "II": ("Angle + Sel-Co", (1, 3, 4, 5)),
    "III": ("Angle + NoSel-Co", (0, 2, 4, 5)),
    "IV": ("Angle", (4, 5)),
    "V": ("All-Co", (0, 1, 2, 3)),
    "VI": ("Sel-Co", (1, 3)),
    "VII": ("NoSel-Co", (0, 2)),
}


@pytest.mark.parametrize("composition", COMPOSITIONS, ids=lambda c: c.name)
def test_compositions_are_the_papers(composition: Composition) -> None:
    # Four switches, of which 3 and 1 are selected, and two joints in columns 4 and 5.
    assert (composition.what, composition.columns((3, 1), 4, 2)) == PAPER[composition.name]


def test_they_stand_in_the_papers_order() -> None:
    assert [composition.name for composition in COMPOSITIONS] == list(PAPER)


@given(st.sets(st.integers(0, 19)), st.integers(1, 5))
def test_selected_and_others_together_are_all(placement: set[int], n_joints: int) -> None:
    by_name = {c.name: set(c.columns(tuple(placement), 20, n_joints)) for c in COMPOSITIONS}
    assert by_name["VI"] | by_name["VII"] == by_name["V"]
    assert not by_name["VI"] & by_name["VII"]
    assert by_name["II"] | by_name["III"] == by_name["I"]
    assert by_name["II"] & by_name["III"] == by_name["IV"]


@pytest.mark.parametrize(
    ("n_switches", "n_joints", "names"),
    [(0, 6, ["IV"]), (60, 0, ["V", "VI", "VII"]), (60, 9, list(PAPER))],
)
def test_a_set_gets_the_compositions_it_has_inputs_for(n_switches: int, n_joints: int, names: list[str]) -> None:
    assert [composition.name for composition in available(n_switches, n_joints)] == names


def test_only_compositions_that_part_the_switches_need_a_placement() -> None:
    assert [c.name for c in COMPOSITIONS if c.needs_placement] == ["II", "III", "VI", "VII"]
