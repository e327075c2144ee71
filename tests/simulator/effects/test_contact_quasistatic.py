"""The default contact model: loads in, contacts out, none depending on the others."""

import numpy as np
import pytest

from thenar.simulator.body.condition import Condition
from thenar.simulator.body.shapes import Pose
from thenar.simulator.contact.balance import Skin
from thenar.simulator.contact.model import Contact, ContactModel
from thenar.simulator.effects.contact_quasistatic import USUAL_SKIN, Quasistatic, model
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import sessions
from thenar.simulator.planning.postures import Postures

from ..small import make_load, make_setting

FIELDS = ("posture_deg", "pose", "forces_n", "capsules_n", "between_n", "settled", "residual_n", "residual_nmm")


@pytest.fixture(scope="module")
def conditions() -> list[Condition]:
    """Four grasps of each of three hands."""
    scene = load_scene("kamakura")
    return [
        condition
        for session in sessions(scene, Postures.shipped(scene.taxonomy))
        for condition in session.conditions
        if condition.grasp in ("PoS", "CMF") or condition.thing.name == "pin"
    ]


@pytest.fixture(scope="module")
def default() -> ContactModel:
    return model(make_setting())


def assert_same(one: Contact, other: Contact, rows: slice = slice(None)) -> None:
    for field in FIELDS:
        assert np.array_equal(getattr(one, field), getattr(other, field)[rows]), field


def test_no_force_is_lost_between_segments_and_switches(conditions: list[Condition], default: ContactModel) -> None:
    for contact in default([make_load(condition) for condition in conditions]):
        shared = contact.forces_n.sum(axis=1) + contact.between_n
        assert shared == pytest.approx(contact.capsules_n.sum(axis=1), rel=1e-12)
        assert (contact.forces_n >= 0.0).all()
        assert (contact.between_n >= 0.0).all()


def test_loads_of_several_hands_come_back_in_their_order(conditions: list[Condition], default: ContactModel) -> None:
    loads = [make_load(condition, 2 + number % 3) for number, condition in enumerate(conditions)]
    assert len({id(one.condition.hand) for one in loads}) > 1
    mixed = loads[::2] + loads[1::2]  # hands in turn, so that none of them stands together
    for one, contact in zip(mixed, default(mixed), strict=True):
        assert_same(default([one])[0], contact)


def test_more_repetitions_than_are_solved_at_a_time_come_out_the_same(
    conditions: list[Condition], default: ContactModel
) -> None:
    many = [make_load(conditions[0], 300, seed) for seed in range(3)]  # bundles hold about 512
    together = default(many)
    assert_same(default(many[2:])[0], together[2])
    assert_same(default(many[:1])[0], together[0])


def test_a_pose_at_rest_is_where_the_object_is_felt(conditions: list[Condition], default: ContactModel) -> None:
    told = make_load(conditions[0], 4)
    (contact,) = default([told])
    condition = told.condition
    centres = condition.hand.spheres(condition.hand.skeleton(np.radians(contact.posture_deg.T)))
    distance = Pose.of(contact.pose.T).distance(condition.thing.shape, centres)[0]
    sunk = condition.hand.sphere_radii[:, None] - distance
    pressed, touched = np.zeros((20, 4)), np.zeros((20, 4), dtype=bool)
    for sphere, capsule in enumerate(condition.hand.sphere_capsules):
        # 3 N per mm, half as much at first, as the parameters say.
        pressed[capsule] += 3.0 * np.where(sunk[sphere] > 0.5, sunk[sphere] - 0.25, np.maximum(sunk[sphere], 0.0) ** 2)
        touched[capsule] |= sunk[sphere] > 0.0
    found = contact.capsules_n.T
    assert found == pytest.approx(pressed, abs=1e-9)
    assert not found[~touched].any()


def test_a_switch_that_reaches_further_feels_more(conditions: list[Condition]) -> None:
    told = [make_load(condition) for condition in conditions]
    lost = [
        sum(contact.between_n.sum() for contact in model(make_setting(), reach_mm=reach)(told))
        for reach in (0.0, 1.0, 3.0)
    ]
    assert lost[0] > lost[1] > lost[2]


def test_what_does_not_come_to_rest_is_marked(conditions: list[Condition]) -> None:
    (contact,) = model(make_setting(), most_steps=1)([make_load(conditions[0])])
    assert not contact.settled.any()
    assert contact.steps == 3


@pytest.mark.parametrize("press_n_per_mm", [5e-324, 1000.0])
@pytest.mark.parametrize("soft_mm", [5e-324, 5.0])
@pytest.mark.parametrize("drag_n_per_mm", [5e-324, 1000.0])
def test_skins_at_the_limits_give_finite_results(
    conditions: list[Condition], press_n_per_mm: float, soft_mm: float, drag_n_per_mm: float
) -> None:
    skin = Skin(press_n_per_mm, soft_mm, drag_n_per_mm, USUAL_SKIN.friction)
    for contact in Quasistatic(skin).solve([make_load(condition, 1) for condition in conditions[:3]]):
        assert all(np.isfinite(getattr(contact, field)).all() for field in FIELDS)
