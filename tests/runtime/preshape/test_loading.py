"""Tables of preshapes: those that ship say what the facts say, and a wrong one of the user's is told where it is."""

import math
import re
from pathlib import Path

import pytest

from thenar.compiler.recordings.taxonomy import published
from thenar.drivers.errors import SettingError
from thenar.runtime.preshape import SHIPPED, PreshapeTable, load_preshapes

OWN = """\
name = "mine"
time_from_start_s = 0.25

[[joints]]
name = "turns"
unit = "deg"
range = [-90, 90]

[[joints]]
name = "slides"
unit = "mm"
range = [0, 40]

[[preshapes]]
name = "open"
positions = [45, 40]
grasps = ["PoS", "CMF"]

[[preshapes]]
name = "closed"
positions = [-90, 0]
grasps = ["Tip"]
"""

# (grasp types, spread in degrees): GraspIt!'s four preshapes, and who takes which.
SPREADS = [
    (("PoS", "PoI", "PoE", "PoD", "PMF", "PE"), 0),
    (("CMF",), 60),
    (("Tip", "Tpd", "TVI", "TVII", "Lat", "Add"), 90),
    (("PoH",), 180),
]


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(OWN)
    return path


def fault(path: Path, old: str, new: str) -> str:
    assert old in OWN
    path.write_text(OWN.replace(old, new, 1))
    with pytest.raises(SettingError) as found:
        load_preshapes(path)
    return str(found.value)


@pytest.mark.parametrize("good", ["turns", "open", "PoS"])
def test_a_name_that_a_terminal_would_obey_is_refused(own: Path, good: str) -> None:
    assert "holds a control character (U+001B)" in fault(own, f'"{good}"', r'"a\u001b[2J"')


@pytest.mark.parametrize(("grasps", "spread"), SPREADS)
def test_the_barrett_hand_spreads_as_graspit_does_and_opens_its_fingers(grasps: tuple[str, ...], spread: int) -> None:
    table = load_preshapes("barrett_bh8")
    for grasp in grasps:
        preshape = table.chosen.get(grasp)
        assert preshape is not None
        stands = dict(zip(preshape.joint_names, preshape.positions, strict=True))
        assert (
            stands.pop("finger_1/prox_joint")
            == stands.pop("finger_2/prox_joint")
            == pytest.approx(math.radians(spread))
        )
        assert set(stands.values()) == {0.0}


def test_the_barrett_hand_has_eight_joints_in_the_urdfs_words() -> None:
    preshape = load_preshapes("barrett_bh8").chosen.get("PoS")
    assert preshape is not None
    assert preshape.joint_names == (
        *(f"finger_1/{part}_joint" for part in ("prox", "med", "dist")),
        *(f"finger_2/{part}_joint" for part in ("prox", "med", "dist")),
        *(f"finger_3/{part}_joint" for part in ("med", "dist")),
    )


def test_no_shipped_position_is_beyond_the_barrett_hands_reach() -> None:
    for preshape in load_preshapes("barrett_bh8").chosen.values():
        assert all(0 <= position <= math.radians(180) for position in preshape.positions)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_table_names_all_of_kamakuras_grasp_types_and_none_that_no_taxonomy_has(name: str) -> None:
    table = load_preshapes(name)
    assert table.check(published("kamakura14").types) == ""
    assert set(table.chosen) <= {*published("kamakura14").types, *published("cutkosky16").types}


def test_where_the_literature_gives_nothing_the_table_says_so() -> None:
    table = load_preshapes("barrett_bh8")
    assert table.chosen.get("Light tool") is None
    assert table.check(published("cutkosky16").types) == (
        "preshapes Barrett BH8: none for Light tool: nothing is sent to the hand for those"
    )


def test_a_table_for_another_taxonomy_is_refused_with_every_grasp_type() -> None:
    types = [f"own {number}" for number in range(9)]
    with pytest.raises(SettingError, match=re.escape(f"none of the build's grasp types ({', '.join(types)})")):
        load_preshapes("barrett_bh8").check(types)


def test_a_misspelt_grasp_type_of_the_table_is_named() -> None:
    shape = load_preshapes("parallel_gripper").chosen["PoS"]
    table = PreshapeTable("Mine", {"laterl": shape, "cup": shape})
    said = "preshapes Mine: none for lateral (the table has 'laterl'), pen: nothing is sent to the hand for those"
    assert table.check(["cup", "lateral", "pen"]) == said
    assert table.check(["lateral"]).startswith("preshapes Mine: none for lateral (the table has 'laterl')")


def test_the_parallel_gripper_opens_wider_for_a_cylinder_than_for_a_needle() -> None:
    table = load_preshapes("parallel_gripper")
    wide, narrow = table.chosen.get("PoS"), table.chosen.get("Tip")
    assert wide is not None
    assert narrow is not None
    assert wide.positions[0] < narrow.positions[0] <= 0.8


def test_ones_own_table_is_in_rad_and_metres_afterwards(own: Path) -> None:
    table = load_preshapes(own)
    preshape = table.chosen.get("CMF")
    assert preshape is not None
    assert preshape.name == "open"
    assert preshape.joint_names == ("turns", "slides")
    assert preshape.positions == pytest.approx((math.pi / 4, 0.04))
    assert preshape.time_from_start_s == 0.25
    assert table.chosen.get("PoS") is preshape
    assert table.chosen.get("Lat") is None


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('unit = "deg"', 'unit = "grad"', "line 6: joints[0].unit: 'grad' is not among its values"),
        ("0.25", "0", "line 2: time_from_start_s: must be above 0, not 0"),
        ("[45, 40]", "[45]", "line 16: preshapes[0].positions: must be 2 positions, one per joint, not 1"),
        ("[45, 40]", "[45, 41]", "line 16: preshapes[0].positions[1]: 41 mm is outside 0 to 40, the range of slides"),
        ("[45, 40]", "[nan, 40]", "line 16: preshapes[0].positions[0]: must be a finite number, not nan"),
        ('["Tip"]', '["PoS"]', "line 22: preshapes[1].grasps[0]: 'PoS' already has preshape 'open'"),
        ('"closed"', '"open"', "line 20: preshapes[1].name: preshape 'open' is already preshapes[0].name"),
        ('"slides"', '"turns"', "line 10: joints[1].name: joint 'turns' is already joints[0].name"),
        ("[0, 40]", "[40, 0]", "line 12: joints[1].range: must be the lowest and then the highest position"),
    ],
)
def test_a_wrong_table_is_told_with_its_line_and_key(own: Path, old: str, new: str, told: str) -> None:
    message = fault(own, old, new)
    assert message.startswith("mine.toml")
    assert told in message


def test_a_table_without_grasp_types_or_joints_is_refused(own: Path) -> None:
    own.write_text('name = "mine"\ntime_from_start_s = 1\njoints = []\npreshapes = []\n')
    with pytest.raises(SettingError, match="line 3: joints: must name at least one joint"):
        load_preshapes(own)
    own.write_text(OWN.replace('"PoS", "CMF"', "").replace('"Tip"', ""))
    with pytest.raises(SettingError, match="preshapes: must name at least one grasp type"):
        load_preshapes(own)


def test_an_unknown_preshape_table_is_answered_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="did you mean 'barrett_bh8'"):
        load_preshapes("barret_bh8")
    with pytest.raises(SettingError, match="cannot be read"):
        load_preshapes(tmp_path)
