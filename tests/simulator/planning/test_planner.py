"""One posture of one hand: its pads touch, nothing sinks in, friction does the rest; or there is none."""

import msgspec
import numpy as np
import pytest

from thenar.simulator.body.condition import Thing
from thenar.simulator.body.hand import Hand, Size
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere
from thenar.simulator.errors import SceneError
from thenar.simulator.planning.plan import shipped_prehensions
from thenar.simulator.planning.planner import BORNE, TOLERANCE_MM, Plan, measure, plan
from thenar.simulator.planning.prehension import pad_sphere

HAND = Hand(Size(188.0, 84.0))
TYPES = shipped_prehensions("kamakura14")
BEAD = Thing("bead", Sphere(12.0), 0.002)


@pytest.fixture(scope="module")
def pinched() -> Plan:
    return plan(HAND, "Tip", TYPES["Tip"], BEAD)


def test_only_a_pinchs_pads_touch_from_two_sides(pinched: Plan) -> None:
    held = pinched.held
    assert [pad.sphere for pad in held.pads] == [pad_sphere(HAND, pad) for pad in TYPES["Tip"].pads]
    # A ball needs no shape: how far its middle is from the middles of the skin's spheres.
    centres = HAND.spheres(HAND.skeleton(np.radians(held.posture_deg)[:, None]))[:, :, 0]
    gaps = np.linalg.norm(centres - held.pose[:3], axis=1) - 6.0 - HAND.sphere_radii
    pads = [pad.sphere for pad in held.pads]
    assert np.abs(gaps[pads]).max() < 0.5
    assert np.delete(gaps, pads).min() > 0.5
    assert (pinched.gap_mm, pinched.sunk_mm) == pytest.approx((gaps[pads].max(), -gaps.min()))
    first, second = centres[pads] - held.pose[:3]
    assert first @ second / np.linalg.norm(first) / np.linalg.norm(second) < -0.95


def test_shares_grip_and_down_belong_to_the_type(pinched: Plan) -> None:
    assert sum(pad.share for pad in pinched.held.pads) == pytest.approx(1.0)
    assert pinched.held.grip_n == TYPES["Tip"].grip_n
    assert np.linalg.norm(pinched.held.down) == pytest.approx(1.0)
    down = msgspec.structs.replace(TYPES["Tip"], down=(0.0, 0.0, -4.0))
    assert plan(HAND, "Tip", down, BEAD, pinched.held).held.down == pytest.approx([0.0, 0.0, -1.0])


def test_hands_of_similar_size_take_similar_postures(pinched: Plan) -> None:
    near = plan(Hand(Size(190.0, 85.0)), "Tip", TYPES["Tip"], BEAD, pinched.held)
    assert np.abs(near.held.posture_deg - pinched.held.posture_deg).max() < 1.0
    assert np.abs(near.held.pose - pinched.held.pose)[:3].max() < 2.0


def test_a_near_posture_that_leads_nowhere_is_not_all_that_is_tried() -> None:
    # From so large a hand the small one comes to press its knuckles into the bar.
    bar, (small, large) = Thing("bar", Cylinder(32.0, 260.0), 0.3), (Hand(Size(120.0, 54.6)), Hand(Size(240.0, 109.2)))
    far = plan(large, "PoS", TYPES["PoS"], bar).held
    alone, led = plan(small, "PoS", TYPES["PoS"], bar), plan(small, "PoS", TYPES["PoS"], bar, far)
    assert alone.holds()
    assert led.held.posture_deg.tolist() == alone.held.posture_deg.tolist()


@pytest.mark.parametrize(
    ("faults", "held"),
    [
        ((TOLERANCE_MM, TOLERANCE_MM, BORNE), True),
        ((TOLERANCE_MM + 0.01, 0.0, 0.0), False),
        ((0.0, TOLERANCE_MM + 0.01, 0.0), False),
        ((0.0, 0.0, BORNE + 0.01), False),
    ],
)
def test_a_plan_holds_up_to_the_bounds(pinched: Plan, faults: tuple[float, float, float], held: bool) -> None:
    assert Plan(pinched.held, 0.0, *faults).holds() is held


# Balls and bars too thick, plates thicker than the hand opens.
PUSHED_AWAY, OFF = "of the push unbalanced (friction bears 62%)", "mm under a pad (at most 4)"
NOT_HELD: list[tuple[str, Shape, str]] = [
    ("Tip", Sphere(190.0), PUSHED_AWAY),
    ("CMF", Sphere(400.0), PUSHED_AWAY),
    ("Tip", Cylinder(150.0, 190.0), PUSHED_AWAY),
    ("PoE", Box(150.0, 160.0, 110.0), PUSHED_AWAY),
    ("PE", Box(150.0, 200.0, 130.0), PUSHED_AWAY),
    ("PoS", Cylinder(6.0, 200.0), OFF),
]


@pytest.mark.slow
@pytest.mark.parametrize(("grasp", "shape", "wrong"), NOT_HELD, ids=[f"{g} {type(s).__name__}" for g, s, _ in NOT_HELD])
def test_an_unholdable_object_is_refused_with_reason_and_advice(grasp: str, shape: Shape, wrong: str) -> None:
    with pytest.raises(SceneError) as refusal:
        plan(HAND, grasp, TYPES[grasp], Thing("monster", shape, 0.1))
    words = str(refusal.value)
    assert words.startswith(f"a hand of 188 mm cannot hold 'monster' with grasp type '{grasp}': the best posture l")
    assert wrong in words
    assert words.endswith("; take an object of another size, or another grasp type for it")
    assert "\n" not in words


def test_what_is_measured_of_a_posture_is_what_its_plan_says(pinched: Plan) -> None:
    assert measure(HAND, pinched.held, BEAD.shape) == (pinched.gap_mm, pinched.sunk_mm)
    # A hair further out, and the pads are as much further from it or deeper in it.
    wider = measure(HAND, pinched.held, Sphere(12.5))
    assert wider == pytest.approx((pinched.gap_mm - 0.25, pinched.sunk_mm + 0.25))
