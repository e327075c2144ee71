import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from thenar.compiler.hand import drawn_joints, grid_hand, moved_by
from thenar.drivers.cyberglove_protocol import SENSORS_22
from thenar.runtime.errors import BuildError
from thenar.runtime.hand import (
    HAND_NAME,
    MAX_BYTES,
    HandDrawing,
    Spot,
    hand_from_bytes,
    hand_to_bytes,
    load_hand,
)
from thenar.runtime.manifest import Calibration, Manifest, Switch, Threshold

from ..tables import describe
from .conftest import make_tables

PAD = Calibration(0, "pad", "N", 0, 0.0, 1000, 10.0)


@pytest.fixture
def manifest() -> Manifest:
    """Return a build of six switches, three levels of a taxel among them, and three joints."""
    made = describe(make_tables(switches=6))
    levels = tuple(Switch(6, f"pad>{code}", 0.1, Threshold(code, code / 100, PAD)) for code in (500, 90, 200))
    return replace(made, switches=(*made.switches[:3], *levels))


def test_without_positions_switches_and_taxels_are_drawn_as_a_grid(manifest: Manifest) -> None:
    hand = grid_hand(manifest)
    assert not hand.placed
    assert [(each.name, each.bit) for each in hand.switches] == [("s0", 0), ("s1", 1), ("s2", 2)]
    assert [(each.name, each.levels) for each in hand.taxels] == [("pad", ((90, 4), (200, 5), (500, 3)))]
    spots: tuple[Spot, ...] = (*hand.switches, *hand.taxels)
    places = {(each.x_mm, each.y_mm) for each in spots}
    assert len(places) == 4
    assert [(each.joint, each.name, each.low, each.high) for each in hand.joints] == [
        (number, f"j{number}", 0.0, 50.0) for number in range(3)
    ]


def test_the_drawing_in_the_folder_is_the_one_that_build_json_seals(tmp_path: Path, manifest: Manifest) -> None:
    drawn = replace(grid_hand(manifest, [(0, 10), (20, 10), (7, 7)]), view="a glove", outline=((0.5, -1.0), (3.0, 2.5)))
    data = hand_to_bytes(drawn)
    sealed = replace(manifest, hand_sha256=hashlib.sha256(data).hexdigest())
    with pytest.raises(BuildError, match=r"hand\.json cannot be read: No such file"):
        load_hand(tmp_path, sealed)
    (tmp_path / HAND_NAME).write_bytes(data)
    assert load_hand(tmp_path, sealed) == drawn
    assert [(each.low, each.high) for each in drawn.joints] == [(0.0, 5.0), (5.0, 10.0), (3.5, 3.5)]
    (tmp_path / HAND_NAME).write_bytes(data.replace(b"a glove", b"a slove"))
    with pytest.raises(BuildError, match=r"not the one that build\.json describes"):
        load_hand(tmp_path, sealed)


def _without(key: str) -> Callable[[dict[str, Any]], object]:
    return lambda document: document.pop(key)


def _set(key: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda document: document.update({key: value})


def _in(kind: str, key: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda document: document[kind][0].update({key: value})


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (_without("joints"), "missing required field"),
        (_set("more", 1), "unknown field"),
        (_set("schema", 2), "has schema 2, this thenar reads 1: compile the build again"),
        (_set("radius_mm", 0), "radius_mm"),
        (_set("outline", [[0, 1e9]]), r"outline"),
        (_set("outline", [[0, 1]] * 70_000), "outline"),
        (_in("switches", "x_mm", "javascript:0"), r"switches\[0\]\.x_mm"),
        (_in("switches", "bit", 1), "draws other switches than the build has"),
        (_in("switches", "bit", 7), "draws other switches than the build has"),
        (_in("switches", "name", "t"), "draws other switches than the build has"),
        (_in("switches", "name", "a\nb"), "a name which"),
        (_in("taxels", "levels", [[90, 4], [201, 5], [500, 3]]), "draws other switches than the build has"),
        (_in("taxels", "levels", [[500, 3], [90, 4], [200, 5]]), "levels of a taxel that do not rise"),
        (_in("joints", "joint", 1), "draws other joints than the build has"),
        (_in("joints", "name", "j1"), "draws other joints than the build has"),
        (lambda document: document["switches"].pop(), "draws other switches than the build has"),
    ],
)
def test_what_is_no_drawing_of_the_build_is_refused(
    manifest: Manifest, change: Callable[[dict[str, Any]], object], reason: str
) -> None:
    document = json.loads(hand_to_bytes(grid_hand(manifest)))
    change(document)
    with pytest.raises(BuildError, match=rf"hand\.json .*{reason}"):
        hand_from_bytes(json.dumps(document).encode(), manifest)


def test_an_oversized_drawing_is_refused(manifest: Manifest) -> None:
    with pytest.raises(BuildError, match=f"a drawing of a hand has at most {MAX_BYTES}"):
        hand_from_bytes(hand_to_bytes(grid_hand(manifest)) + b" " * MAX_BYTES, manifest)


def test_a_build_of_joints_alone_draws_joints_alone(manifest: Manifest) -> None:
    hand = grid_hand(replace(manifest, switches=()))
    assert (hand.switches, hand.taxels, hand.view, len(hand.joints)) == ((), (), "", 3)
    assert msgspec.json.decode(hand_to_bytes(hand), type=HandDrawing) == hand


def test_every_sensor_of_a_cyberglove_moves_a_part_of_its_own() -> None:
    moved = [moved_by(name) for name in SENSORS_22]
    assert len(set(moved)) == 22
    assert ("", "") not in moved
    assert moved_by("middle_index_abduction") == ("index", "abduction")
    assert moved_by("little_ring_abduction") == ("little", "abduction")


@pytest.mark.parametrize(
    ("name", "moves"),
    [
        ("IndexPIP", ("index", "pip")),
        ("index ip", ("index", "pip")),
        ("thumb_cmc_flexion", ("thumb", "rotation")),
        ("thumb_cmc_abduction", ("thumb", "abduction")),
        ("pinky", ("little", "curl")),
        ("ring_flex", ("ring", "curl")),
        ("wrist_flexion", ("wrist", "pitch")),
        ("wrist_temperature", ("", "")),
        ("index_temperature", ("", "")),
        ("flex3_hold", ("", "")),
        ("<b>tip", ("", "")),
    ],
)
def test_names_say_what_a_joint_moves_or_nothing(name: str, moves: tuple[str, str]) -> None:
    assert moved_by(name) == moves


def test_values_rise_whatever_way_the_codes_run() -> None:
    falling = Calibration(0, "index_mcp", "deg", 100, 0.0, 0, 90.0)
    (joint,) = drawn_joints([falling], [(10, 50)])
    assert (joint.low, joint.high) == (45.0, 81.0)
