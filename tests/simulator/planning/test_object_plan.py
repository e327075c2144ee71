"""One object over hands of all lengths; and the shipped postures, measured without the planner."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest

from thenar.simulator.body.condition import PlannedGrasp, Thing
from thenar.simulator.body.hand import Hand
from thenar.simulator.body.shapes import Pose, Shape, Sphere
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.planning.plan import Work, average_hand, entry_of, plan_object, shipped_prehensions
from thenar.simulator.planning.planner import Plan
from thenar.simulator.planning.postures import Entry, Postures
from thenar.simulator.planning.prehension import pad_sphere

TYPES = shipped_prehensions("kamakura14")
SHIPPED = [(name, entry) for name in ("kamakura14", "cutkosky16") for entry in Postures.shipped(name).entries]
NAMES = [f"{entry.grasp}: {entry.object}" for _, entry in SHIPPED]
LENGTHS = [150.0, 165.0, 180.0, 195.0, 210.0, 225.0]

# What holds of the shipped postures, at planned lengths and between them: mm under a pad, mm that skin sinks in.
PLANNED_MM = (3.0, 3.0)
BETWEEN_MM = (4.0, 3.0)


def gaps(hand: Hand, held: PlannedGrasp, shape: Shape) -> np.ndarray:
    """Return how far each sphere of skin (m,) is from an object, in mm; below 0 it sinks in."""
    centres = hand.spheres(hand.skeleton(np.radians(held.posture_deg)[:, None]))
    return Pose.of(held.pose[:, None]).distance(shape, centres)[0][:, 0] - hand.sphere_radii


def worst(hand: Hand, entry: Entry) -> tuple[float, float]:
    """Return the widest gap under a pad, and the deepest that skin sinks in."""
    held = Postures("", (entry,)).held(hand, entry.grasp, Thing(entry.object, entry.shape, 0.1))
    found = gaps(hand, held, entry.shape)
    return found[list(entry.spheres)].max(), -found.min()


@pytest.mark.parametrize("entry", [entry for _, entry in SHIPPED], ids=NAMES)
def test_all_pads_of_a_shipped_posture_touch_and_nothing_sinks_in(entry: Entry) -> None:
    assert [held.length_mm for held in entry.held] == LENGTHS
    found = np.array([worst(average_hand(length), entry) for length in LENGTHS])
    assert (found <= PLANNED_MM).all()


@pytest.mark.slow
@pytest.mark.parametrize("entry", [entry for _, entry in SHIPPED], ids=NAMES)
def test_so_it_is_between_the_planned_lengths(entry: Entry) -> None:
    found = np.array([worst(average_hand(length), entry) for length in np.arange(150.0, 225.1, 1.25)])
    assert (found <= BETWEEN_MM).all()


@pytest.mark.parametrize("scene", ["kamakura", "kamakura-def", "cutkosky", "cutkosky-def"])
def test_so_it_is_for_the_hands_of_the_shipped_scenes(scene: str) -> None:
    loaded = load_scene(scene)
    entries = Postures.shipped(loaded.taxonomy).entries
    found = np.array([worst(subject.hand(), entry) for subject in loaded.subjects for entry in entries])
    assert (found <= 4.0).all()


@pytest.mark.parametrize("entry", [entry for _, entry in SHIPPED], ids=NAMES)
def test_shares_of_a_shipped_posture_sum_to_one_as_rounded(entry: Entry) -> None:
    for held in entry.held:
        assert min(held.shares) >= 0.0
        assert sum(held.shares) == pytest.approx(1.0, abs=5e-5 * len(held.shares))
    assert np.linalg.norm(entry.down) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(("taxonomy", "entry"), SHIPPED, ids=NAMES)
def test_shipped_postures_press_with_their_tables_pads_and_grip(taxonomy: str, entry: Entry) -> None:
    prehension = shipped_prehensions(taxonomy)[entry.grasp]
    hand = average_hand(188.0)
    assert list(entry.spheres) == [pad_sphere(hand, pad) for pad in prehension.pads]
    assert entry.grip_n == prehension.grip_n


@pytest.mark.parametrize("entry", [entry for _, entry in SHIPPED], ids=NAMES)
def test_the_turns_of_neighbouring_lengths_are_near_each_other(entry: Entry) -> None:
    for low, high in pairwise(entry.held):
        assert np.linalg.norm(np.subtract(low.pose[3:], high.pose[3:])) < 1.0


@pytest.mark.parametrize("entry", [entry for _, entry in SHIPPED if "lid" in entry.object])
def test_a_lids_axis_points_out_of_the_palm(entry: Entry) -> None:
    for held in entry.held:
        axis = Pose.of(np.array(held.pose)[:, None]).rotation[:, 0, 0]
        assert abs(axis[2]) > 0.6


@pytest.fixture(scope="module")
def bead() -> Entry:
    return plan_object(Work("Tip", TYPES["Tip"], Thing("bead", Sphere(12.0), 0.002), 180.0, 195.0))


def test_further_hands_are_planned_besides_and_leave_the_others_as_they_are(bead: Entry) -> None:
    further = plan_object(Work("Tip", TYPES["Tip"], Thing("bead", Sphere(12.0), 0.002), 135.0, 240.0))
    assert [held.length_mm for held in further.held] == [135.0, *LENGTHS, 240.0]
    for held, known in zip(further.held[1:-1], bead.held, strict=True):
        assert (held.posture_deg, held.shares) == (known.posture_deg, known.shares)
        assert held.pose == pytest.approx(known.pose)
    for length in (135.0, 142.5, 232.5, 240.0):
        assert max(worst(average_hand(length), further)) < 1.0


@pytest.mark.slow
def test_a_thing_for_large_hands_is_planned_for_large_hands_alone() -> None:
    ball = Thing("ball", Sphere(180.0), 0.2)
    entry = plan_object(Work("CMF", TYPES["CMF"], ball, 195.0, 210.0))
    lengths = [held.length_mm for held in entry.held]
    assert 150.0 < lengths[0] <= 195.0
    assert lengths[-1] == 225.0
    with pytest.raises(SceneError, match=f"a hand of {lengths[0] - 15.0:g} mm cannot hold 'ball'"):
        plan_object(Work("CMF", TYPES["CMF"], ball, 150.0, 210.0))


@pytest.mark.slow
def test_of_two_ways_to_hold_a_thing_all_lengths_take_the_better() -> None:
    # Planned outwards alone, a finger lies on the other side of the spoon at 195 mm than at 180 and 210.
    types = shipped_prehensions("cutkosky16")
    (spoon,) = (item for item in load_scene("cutkosky").objects if item.name == "wooden spoon")
    entry = plan_object(Work(spoon.grasp, types[spoon.grasp], spoon.thing(), 180.0, 210.0))
    assert max(max(worst(average_hand(length), entry)) for length in np.arange(150.0, 225.1, 7.5)) < 1.0
    for low, high in pairwise(entry.held):
        assert np.abs(np.subtract(low.posture_deg, high.posture_deg)).max() < 6.0


def test_a_lid_near_half_a_turn_varies_little_between_hands() -> None:
    # As a rotation vector, a little beyond half a turn is nearly half a turn the other way.
    held = PlannedGrasp(np.zeros(20), np.zeros(6), (), 10.0)
    poses = [np.array([0.0, 0.0, 0.0, turn, 0.0, 0.0]) for turn in (3.0, 3.1, 3.2 - 2 * np.pi, 3.3 - 2 * np.pi)]
    plans = {
        150.0 + 15.0 * place: Plan(dataclasses.replace(held, pose=pose), 0.0, 0.0, 0.0, 0.0)
        for place, pose in enumerate(poses)
    }
    entry = entry_of(Work("CMF", TYPES["CMF"], Thing("lid", Sphere(80.0), 0.1), 150.0, 195.0), plans)
    assert [round(one.pose[3], 3) for one in entry.held] == [3.0, 3.1, 3.2, 3.3]
