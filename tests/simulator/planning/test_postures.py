"""Planned postures as data: what lies between two lengths, and what is said where there is none."""

import json
import re
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.simulator.body.condition import PlannedGrasp, Thing
from thenar.simulator.body.hand import Hand, Size
from thenar.simulator.body.shapes import rotation
from thenar.simulator.contact.model import GRAVITY
from thenar.simulator.errors import SceneError
from thenar.simulator.planning.postures import FRICTION, Entry, Postures

SHIPPED = {name: Postures.shipped(name) for name in ("kamakura14", "cutkosky16")}
ENTRIES = [entry for postures in SHIPPED.values() for entry in postures.entries]
PIN = next(entry for entry in SHIPPED["kamakura14"].entries if entry.object == "pin")


def held(entry: Entry, length_mm: float, mass_kg: float = 0.0) -> PlannedGrasp:
    thing = Thing(entry.object, entry.shape, mass_kg)
    return Postures("", (entry,)).held(Hand(Size(length_mm, 80.0)), entry.grasp, thing)


def numbers(one: PlannedGrasp) -> np.ndarray:
    return np.concatenate([one.posture_deg, one.pose, [pad.share for pad in one.pads]])


@given(st.sampled_from(ENTRIES), st.data())
def test_at_a_planned_length_the_posture_is_exactly_planned(entry: Entry, data: st.DataObject) -> None:
    planned = data.draw(st.sampled_from(entry.held))
    assert numbers(held(entry, planned.length_mm)).tolist() == [*planned.posture_deg, *planned.pose, *planned.shares]


@given(st.sampled_from(ENTRIES), st.data())
def test_between_two_lengths_it_lies_between_theirs_by_plain_arithmetic(entry: Entry, data: st.DataObject) -> None:
    above = data.draw(st.integers(1, len(entry.held) - 1))
    low, high = entry.held[above - 1], entry.held[above]
    length = data.draw(st.floats(low.length_mm, high.length_mm))
    # Python's floats, one product and one sum at a time: the same bits on every machine.
    part = (length - low.length_mm) / (high.length_mm - low.length_mm)
    between = zip(
        (*low.posture_deg, *low.pose, *low.shares), (*high.posture_deg, *high.pose, *high.shares), strict=True
    )
    assert numbers(held(entry, length)).tolist() == [a * (1.0 - part) + b * part for a, b in between]


@given(
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
    st.floats(-0.01, 0.01),
    st.floats(-0.01, 0.01),
)
def test_interpolation_keeps_half_turns_of_either_sign(axis: tuple[float, ...], more: float, less: float) -> None:
    unit = np.array(axis) / np.linalg.norm(axis)
    low, high, *others = PIN.held
    turns = [replace(one, pose=(*one.pose[:3], *turn.tolist())) for one, turn in
             ((low, (np.pi - more) * unit), (high, (less - np.pi) * unit))]  # fmt: skip
    entry = replace(PIN, held=(*turns, *others))
    middle = held(entry, (low.length_mm + high.length_mm) / 2.0).pose[3:]
    expected = rotation((np.pi + (less - more) / 2.0) * unit[:, None])
    assert rotation(middle[:, None]) == pytest.approx(expected, abs=1e-12)


@given(*[st.tuples(*[st.floats(-3.0, 3.0)] * 3)] * 2)
@example((-2.64, 0.0, 0.0), (0.5, 0.0, 0.0))
@example((3.0, 0.0, 0.0), (0.0, 0.0, 0.0))
def test_planned_lengths_turn_objects_as_planned(before: tuple[float, ...], planned: tuple[float, ...]) -> None:
    low, high, *others = PIN.held
    turned = [replace(one, pose=(*one.pose[:3], *turn)) for one, turn in ((low, before), (high, planned))]
    got = held(replace(PIN, held=(*turned, *others)), high.length_mm).pose[3:]
    assert rotation(got[:, None]) == pytest.approx(rotation(np.array(planned)[:, None]), abs=1e-12)


def test_what_comes_with_a_posture_is_its_entrys() -> None:
    one = held(PIN, 188.0, mass_kg=0.2)
    assert tuple(pad.sphere for pad in one.pads) == PIN.spheres
    assert tuple(one.down) == PIN.down
    assert one.grip_n == PIN.grip_n + 0.2 * GRAVITY / FRICTION


def test_a_hand_beyond_the_planned_ones_has_no_posture() -> None:
    for length in (149.9, 225.1):
        with pytest.raises(SceneError, match=f"grasp type 'Tip' with object 'pin' for a hand of {length} mm"):
            held(PIN, length)


def test_postures_of_one_length_hold_for_that_length_alone() -> None:
    one = msgspec.structs.replace(PIN, held=PIN.held[2:3])
    assert numbers(held(one, 180.0)).tolist() == numbers(held(PIN, 180.0)).tolist()
    with pytest.raises(SceneError, match="for a hand of 181 mm"):
        held(one, 181.0)


@pytest.mark.parametrize(
    ("grasp", "shape"),
    [("Lat", PIN.shape), ("Tip", msgspec.structs.replace(PIN.shape, diameter_mm=PIN.shape.extent_mm()[1] + 0.01))],
    ids=["another type", "another shape"],
)
def test_another_type_or_a_changed_shape_finds_no_old_posture(grasp: str, shape: object) -> None:
    thing = Thing("pin", shape, 0.001)  # type: ignore[arg-type]
    assert SHIPPED["kamakura14"].entry(grasp, thing) is None
    with pytest.raises(SceneError, match=f"^no planned posture of grasp type '{grasp}' with object 'pin' for a hand"):
        SHIPPED["kamakura14"].held(Hand(Size(188.0, 84.0)), grasp, thing)


def test_another_name_or_mass_finds_the_posture_of_the_same_shape() -> None:
    assert SHIPPED["kamakura14"].entry("Tip", Thing("needle", PIN.shape, 3.0)) == PIN


def test_of_two_entries_for_one_grasp_the_later_counts() -> None:
    stronger = msgspec.structs.replace(PIN, grip_n=99.0)
    postures = Postures("kamakura14", (*SHIPPED["kamakura14"].entries, stronger))
    assert len(postures.entries) == len(SHIPPED["kamakura14"].entries)
    assert postures.entry("Tip", Thing("pin", PIN.shape, 0.001)) == stronger


@pytest.mark.parametrize("name", SHIPPED)
def test_what_is_saved_is_read_back_and_saved_alike(name: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    SHIPPED[name].save(path)
    again = Postures.load(path)
    assert (again.taxonomy, again.entries) == (name, SHIPPED[name].entries)
    again.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()
    assert len(path.read_bytes()) < 65_000


def test_a_taxonomy_without_shipped_postures_has_none() -> None:
    assert Postures.shipped("feix33").entries == ()


def broken(**changes: object) -> bytes:
    """Return a file of one entry whose first posture, or which itself, is changed."""
    entry = json.loads(msgspec.json.encode(PIN))
    for key, value in changes.items():
        (entry if key in entry else entry["held"][0])[key] = value
    return json.dumps({"format": 1, "taxonomy": "kamakura14", "entries": [entry]}).encode()


BROKEN = {
    "no JSON": (b"{", "truncated"),
    "no text": (b'{"format":1,"taxonomy":"\xff"}', "utf-8"),
    "another thing": (b"[]", "Expected `object`"),
    "no format": (b"{}", "`format`"),
    "a foreign format": (b'{"format":2,"hands":[]}', "Invalid enum value 2 - at `$.format`"),
    "a key too many": (b'{"format":1,"taxonomy":"a","entries":[],"more":1}', "`more`"),
    "19 angles": (broken(posture_deg=[0.0] * 19), "length >= 20 - at `$.entries[0].held[0].posture_deg`"),
    "7 numbers of a pose": (broken(pose=[0.0] * 7), "length <= 6 - at `$.entries[0].held[0].pose`"),
    "a pulling pad": (broken(shares=[1.5, -0.5]), "at `$.entries[0].held[0].shares[0]`"),
    "a share too few": (broken(shares=[1.0]), "'pin' has 2 spheres, but not a share for each"),
    "skin that no hand has": (broken(spheres=[3, 50]), "at `$.entries[0].spheres[1]`"),
    "no hands": (broken(held=[]), "at `$.entries[0].held`"),
    "hands in disorder": (broken(length_mm=500.0), "the hands of 'pin' are not in order"),
    "no grip": (broken(grip_n=0), "at `$.entries[0].grip_n`"),
    "another shape": (broken(shape={"shape": "cone"}), "Invalid value 'cone'"),
    "a number beyond all floats": (broken().replace(b"150.0", b"1e999", 1), "out of range"),
}


@pytest.mark.parametrize(("content", "told"), BROKEN.values(), ids=BROKEN)
def test_a_file_that_holds_no_postures_is_refused(content: bytes, told: str) -> None:
    # Releases of msgspec spell the name of the encoding in either case.
    with pytest.raises(ValueError, match=f"(?i){re.escape(told)}"):
        Postures.decode(content)


@given(st.data())
def test_a_file_cut_short_is_refused_wherever_it_is_cut(data: st.DataObject) -> None:
    content = broken()
    end = data.draw(st.integers(0, len(content) - 1))
    with pytest.raises(ValueError):
        Postures.decode(content[:end])
