"""`murakami160`: 160 switches on the palm side and the sides of the fingers, on every hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.body.hand import CAPSULES, Hand, Size
from thenar.simulator.body.layout import STANDS_OUT_MM, SwitchPlaces, murakami160

LAYOUT = murakami160()
SIZES = st.builds(Size, length_mm=st.floats(160.0, 215.0), breadth_mm=st.floats(72.0, 98.0))
CONTACT_MM = 3.2
FLAT = np.zeros((20, 1))


def own_axes(hand: Hand) -> tuple[np.ndarray, np.ndarray]:
    """Return the tops of all switches on the axes of their capsules: (s, 3), and the capsules (s,)."""
    switches = SwitchPlaces(hand, LAYOUT)
    return switches.places, switches.capsules


def test_switches_are_numbered_capsule_by_capsule_and_named_after_them() -> None:
    capsules = [patch.capsule for patch in LAYOUT]
    assert capsules == sorted(capsules)
    assert set(capsules) == set(range(20))
    assert all(patch.name.rpartition("_")[0] == CAPSULES[patch.capsule] for patch in LAYOUT)


@given(SIZES)
def test_every_contact_stands_out_of_the_skin_by_its_height(size: Size) -> None:
    hand = Hand(size)
    places, capsules = own_axes(hand)
    # Along a capsule its axis is nearest, beyond the last sphere of a fingertip that sphere is.
    tip = np.array([patch.along < 0.0 for patch in LAYOUT])
    last = np.array([hand.sphere_offsets[hand.sphere_capsules == capsule].max() for capsule in capsules])
    off_axis = np.where(tip[:, None], places - np.stack([last, 0 * last, 0 * last], axis=1), places * [0.0, 1.0, 1.0])
    assert np.linalg.norm(off_axis, axis=1) == pytest.approx(hand.radii[capsules] + STANDS_OUT_MM, rel=1e-12)
    assert (places[:, 0] >= 0.0).all()


def test_switches_lie_on_palm_and_sides_never_the_back() -> None:
    places, _ = own_axes(Hand(Size(185.0, 83.0)))
    assert (places[:, 2] < 0.0).all()


def test_every_finger_has_switches_on_both_sides() -> None:
    for capsule in range(3, 15):
        around = [patch.around_deg for patch in LAYOUT if patch.capsule == capsule and patch.along >= 0.0]
        assert min(around) < -60.0
        assert max(around) > 60.0


@given(SIZES)
def test_no_two_contacts_of_a_capsule_share_a_place(size: Size) -> None:
    places, capsules = own_axes(Hand(size))
    for capsule in range(20):
        own = places[capsules == capsule]
        apart = np.linalg.norm(own[:, None] - own[None], axis=2)[np.triu_indices(len(own), 1)]
        assert apart.min() > CONTACT_MM


@given(st.integers(0, 19), st.floats(-0.5, 1.0))
def test_switches_go_with_the_capsules_they_sit_on(joint: int, angle: float) -> None:
    hand = Hand(Size(185.0, 83.0))
    switches = SwitchPlaces(hand, LAYOUT)
    skeleton = hand.skeleton(FLAT + angle * np.eye(20)[:, [joint]])
    relative = switches.tops(skeleton) - skeleton.origins[switches.capsules]
    own = np.einsum("sxkn,sxn->sk", skeleton.frames[switches.capsules], relative)
    assert own == pytest.approx(switches.places, abs=1e-11)


def test_radial_switches_lie_on_the_radial_side() -> None:
    hand = Hand(Size(185.0, 83.0))
    skeleton = hand.skeleton(FLAT)
    tops = SwitchPlaces(hand, LAYOUT).tops(skeleton)[..., 0]
    for patch, top in zip(LAYOUT, tops, strict=True):
        if 3 <= patch.capsule < 15 and abs(patch.around_deg) > 60.0:
            middle = skeleton.origins[patch.capsule, :, 0]
            across = skeleton.frames[patch.capsule, :, 1, 0] @ (top - middle)
            assert np.sign(across) == np.sign(patch.around_deg), patch.name
