"""What hands are told: how skin gives, what presses, and where skin first touches."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.body.condition import Condition
from thenar.simulator.body.shapes import Pose
from thenar.simulator.contact.balance import Skin, command, turned
from thenar.simulator.contact.model import torques

from ..small import make_case

SKINS = st.builds(
    Skin,
    press_n_per_mm=st.floats(0.1, 100.0),
    soft_mm=st.floats(0.05, 5.0),
    drag_n_per_mm=st.floats(0.1, 100.0),
    friction=st.floats(0.0, 2.0),
)


@given(SKINS, st.floats(-5.0, 10.0))
def test_the_stiffness_of_skin_is_the_derivative_of_its_force(skin: Skin, sunk: float) -> None:
    step = 1e-6
    force, stiffness = skin.press(np.array([sunk - step, sunk, sunk + step]))
    # The stiffness has kinks at 0 and `soft_mm`: there a difference sees half of either side.
    assert (force[2] - force[0]) / (2 * step) == pytest.approx(
        stiffness[1], abs=2 * step * skin.press_n_per_mm / skin.soft_mm + 1e-7 * skin.press_n_per_mm
    )


@given(SKINS, st.floats(0.0, 10.0))
def test_deep_skin_is_a_spring_from_half_the_soft_depth(skin: Skin, deeper: float) -> None:
    force, stiffness = skin.press(np.array([skin.soft_mm + deeper]))
    assert stiffness[0] == pytest.approx(skin.press_n_per_mm)
    assert force[0] == pytest.approx(skin.press_n_per_mm * (deeper + skin.soft_mm / 2))


def test_skin_first_touches_where_it_is(by_grasp: dict[str, Condition]) -> None:
    told = command([make_case(by_grasp[grasp]) for grasp in ("PoS", "Tip", "CMF")])
    hand, skeleton = told.hand, told.hand.skeleton(told.angles)
    of_skin = skeleton.origins[hand.sphere_capsules] + turned(skeleton.frames[hand.sphere_capsules], told.skin_points)
    of_object = told.pose.outward(told.object_points) + told.pose.position
    assert of_skin == pytest.approx(of_object, abs=1e-10)
    from_middle = np.linalg.norm(of_skin - hand.spheres(skeleton), axis=1)
    assert from_middle == pytest.approx(np.broadcast_to(hand.sphere_radii[:, None], from_middle.shape), rel=1e-9)


def test_weight_pulls_down_with_mass(by_grasp: dict[str, Condition]) -> None:
    condition = by_grasp["PoS"]
    weight = command([make_case(condition, 4)]).weight
    assert weight == pytest.approx(np.tile(condition.held.down[:, None] * condition.thing.mass_kg * 9.80665, 4))


def test_torque_is_that_of_the_grip(by_grasp: dict[str, Condition]) -> None:
    case = make_case(by_grasp["Tip"], 4)
    unit = torques(case.condition, case.condition.hand.skeleton(case.angles), Pose.of(case.numbers))
    assert command([case]).torque == pytest.approx(unit * case.grip_n)
