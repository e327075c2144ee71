"""Tables of grasp types: what pads mean, and what is said of a table that cannot be planned from."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.recordings.taxonomy import published
from thenar.simulator.body.hand import CAPSULES, LIMITS_DEG, Hand, Size
from thenar.simulator.errors import SceneError
from thenar.simulator.planning.plan import shipped_prehensions
from thenar.simulator.planning.prehension import load_prehensions, pad_side, pad_sphere

HAND = Hand(Size(188.0, 84.0))
PINCH = """\
[types.Tip]
thumb = [45, 30, 20, 40]
index = [5, 40, 50, 30]
middle = [0, 30, 30, 20]
ring = [0, 30, 30, 20]
little = [0, 30, 30, 20]
pads = ["thumb_distal", "index_distal"]
at = [0.6, 0.2, -0.3]
away = [0, 0, -1]
axis = [0, 1, 0]
up = [0, 0, 1]
grip_n = 10
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("taxonomy", ["kamakura14", "cutkosky16"])
def test_exactly_the_shipped_taxonomies_types_have_tables(taxonomy: str) -> None:
    assert set(shipped_prehensions(taxonomy)) == set(published(taxonomy).types)


@pytest.mark.parametrize("taxonomy", ["kamakura14", "cutkosky16"])
def test_the_shipped_pads_are_skin_of_the_segments_that_they_name(taxonomy: str) -> None:
    for prehension in shipped_prehensions(taxonomy).values():
        for pad in prehension.pads:
            segment = CAPSULES[HAND.sphere_capsules[pad_sphere(HAND, pad)]]
            assert pad.startswith(segment)
            assert np.linalg.norm(pad_side(pad)) == pytest.approx(1.0, abs=0.02)


def test_a_type_is_read_with_its_defaults(tmp_path: Path) -> None:
    (tip,) = load_prehensions(written(tmp_path, PINCH)).values()
    assert (tip.down, tip.loose, tip.grip_n) == ((0.0, -1.0, 0.0), 10.0, 10.0)
    assert tip.nominal_deg().tolist()[:8] == [45, 30, 20, 40, 5, 40, 50, 30]


@pytest.mark.parametrize("capsule", CAPSULES)
def test_spheres_count_from_1_bare_segments_mean_tip_or_middle(capsule: str) -> None:
    spheres = np.flatnonzero(HAND.sphere_capsules == CAPSULES.index(capsule)).tolist()
    assert [pad_sphere(HAND, f"{capsule}.{number + 1}") for number in range(len(spheres))] == spheres
    usual = spheres[-1] if capsule.endswith("distal") else spheres[len(spheres) // 2]
    assert pad_sphere(HAND, capsule) == pad_sphere(HAND, f"{capsule}:radial") == usual


@given(st.one_of(st.text(), st.from_regex(r"(thumb|index|palm)_(distal|heel)\.?\d*:?\w*", fullmatch=True)))
def test_a_pads_name_is_skin_of_the_hand_or_refused(pad: str) -> None:
    try:
        sphere, side = pad_sphere(HAND, pad), pad_side(pad)
    except ValueError:
        return
    assert 0 <= sphere < len(HAND.sphere_capsules)
    assert side.shape == (3,)


BAD = [
    (
        '"thumb_distal"',
        '"thumb_distant"',
        "line 7: types.Tip.pads[0]: 'thumb_distant': there is no segment 'thumb_dista",
    ),
    ('"thumb_distal"', '"thumb_distal:palmar"', "types.Tip.pads[0]: 'thumb_distal:palmar': there is no side 'palmar'"),
    (
        '"index_distal"',
        '"index_distal.3"',
        "types.Tip.pads[1]: 'index_distal.3': index_distal has spheres of skin 1 to 2",
    ),
    (
        '"index_distal"',
        '"index_distal.0"',
        "types.Tip.pads[1]: 'index_distal.0': index_distal has spheres of skin 1 to 2",
    ),
    ('"index_distal"', '"index_distal.x"', "types.Tip.pads[1]: 'index_distal.x' is not a pad: write CAPSULE"),
    ('"index_distal"', '"thumb_distal.2"', "types.Tip.pads[1]: 'thumb_distal.2' is the same skin as 'thumb_distal'"),
    ('"thumb_distal", ', "", "types.Tip.pads: "),
    ('"index_distal"', "3", "types.Tip.pads[1]: must be text, not 3"),
    (
        "axis = [0, 1, 0]",
        "axis = [0, 0, 0]",
        "line 10: types.Tip.axis: is a direction: not all of its numbers can be 0",
    ),
    ("away = [0, 0, -1]", "away = [0, 0, 0]", "types.Tip.away: is a direction"),
    ("up = [0, 0, 1]", "up = [0, 0, 0]", "types.Tip.up: is a direction"),
    ("grip_n = 10", "grip_n = 10\ndown = [0, 0, 0]", "types.Tip.down: is a direction"),
    ("up = [0, 0, 1]", "up = [0, -2, 0]", "line 11: types.Tip.up: is parallel to `axis`"),
    ("up = [0, 0, 1]", "up = [0, 0, inf]", "types.Tip.up[2]: must be a finite number"),
    ("up = [0, 0, 1]", "up = [0, 1]", "types.Tip.up: "),
    ("up = [0, 0, 1]\n", "", "line 1: types.Tip: the key up is missing"),
    ("grip_n = 10", "grip_n = 0", "line 12: types.Tip.grip_n: must be above 0, not 0"),
    ("grip_n = 10", "grip_n = 10\nloose = 0", "types.Tip.loose: must be above 0, not 0"),
    ("grip_n = 10", "grip_kg = 1", "types.Tip.grip_kg: "),
    ("thumb = [45,", "thumb = [75,", "line 2: types.Tip.thumb[0]: must be -10 to 70, the range of the joint, not 75"),
    ("[types.Tip]", "[typos.Tip]", "line 1: the key types is missing"),
    (PINCH, "types = 3", "types: must be a table, not 3"),
    (PINCH, "types.Tip = 3", "types.Tip: must be a table, not 3"),
    ("[types.Tip]", "[types.Tip", "mine.toml is not valid TOML"),
]


@pytest.mark.parametrize(("here", "instead", "told"), BAD, ids=[told for *_, told in BAD])
def test_a_bad_table_is_refused_with_file_type_and_key(here: str, instead: str, told: str, tmp_path: Path) -> None:
    assert here in PINCH
    with pytest.raises(SceneError) as refusal:
        load_prehensions(written(tmp_path, PINCH.replace(here, instead, 1)))
    assert str(refusal.value).startswith("mine.toml")
    assert told in str(refusal.value)
    assert "\n" not in str(refusal.value).split("is not valid TOML")[0]


def test_a_missing_table_and_one_that_is_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"mine\.toml: cannot be read: No such file"):
        load_prehensions(tmp_path / "mine.toml")
    (tmp_path / "mine.toml").write_bytes(b"[types.T\xff]")
    with pytest.raises(SceneError, match="not UTF-8"):
        load_prehensions(tmp_path / "mine.toml")


def test_angles_at_the_very_ends_of_a_joint_are_allowed(tmp_path: Path) -> None:
    low, high = LIMITS_DEG[0]
    for end in (low, high):
        (tip,) = load_prehensions(written(tmp_path, PINCH.replace("[45,", f"[{end},"))).values()
        assert tip.thumb[0] == end
