"""Forces on hand and object against sums written out, surfaces of objects, what hands are told of skin and touch."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.body.condition import Condition
from thenar.simulator.body.hand import LIMITS_DEG
from thenar.simulator.body.shapes import Box, Cylinder, Pose, Shape, Sphere
from thenar.simulator.contact.balance import (
    HOLD_N_PER_MM,
    HOLD_NMM_PER_RAD,
    LIMIT_NMM_PER_RAD,
    Balance,
    Skin,
    command,
    surfaces,
    turned,
)
from thenar.simulator.contact.model import STIFFNESS, torques

from ..small import make_load

GRASPS = ("PoS", "PoH", "CMF", "PMF", "PE")


@pytest.fixture(scope="module", params=GRASPS)
def balance(request: pytest.FixtureRequest, by_grasp: dict[str, Condition], skin: Skin) -> Balance:
    """Hands a little off where they were told to be, so that skin is both pressed and dragged."""
    told = command([make_load(by_grasp[request.param], 4)])
    draw = np.random.default_rng(7)
    step = draw.normal(size=(6, 4)) * np.array([0.4] * 3 + [0.01] * 3)[:, None]
    return Balance(told, skin, told.angles + 0.02 * draw.normal(size=(20, 4)), told.pose.moved(step))


def moved(balance: Balance, angles: np.ndarray, step: np.ndarray, sticks: float = 1.0) -> Balance:
    """Return the same hands and objects moved on by some angles (20, n) and step (6, n)."""
    return Balance(balance.command, balance.skin, balance.angles + angles, balance.pose.moved(step), sticks)


def test_some_skin_is_pressed_and_dragged(balance: Balance) -> None:
    assert (balance.presses > 0.1).any(axis=0).all()
    assert (np.linalg.norm(balance.dragged, axis=1)[balance.presses > 0.1] > 0.01).any()


def test_the_object_bears_weight_and_opposite_contact_forces(balance: Balance) -> None:
    skin_feels = sum(balance.forces[sphere] for sphere in range(50))
    shift = balance.pose.position - balance.command.pose.position
    expected = balance.command.weight - skin_feels - HOLD_N_PER_MM * shift
    assert balance.on_object[:3] == pytest.approx(expected, abs=1e-9)


def test_the_objects_moments_are_those_of_its_contact_forces(balance: Balance) -> None:
    touch = balance.levers + balance.pose.position
    about = sum(np.cross(touch[s] - balance.pose.position, -balance.forces[s], axis=0) for s in range(50))
    held = balance.on_object[3:] - about
    # What is left is the soft spring that holds the object: small, and against its turn.
    turned = Pose(balance.command.pose.position, balance.command.pose.rotation)
    relative = np.einsum("ijn,kjn->ikn", balance.pose.rotation, turned.rotation)
    axis = np.stack([relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]])
    assert held == pytest.approx(-HOLD_NMM_PER_RAD * axis / 2, abs=1e-9)


def test_joints_bear_the_moments_of_skin_against_springs_grip_and_limits(balance: Balance) -> None:
    touch = balance.levers + balance.pose.position
    skeleton, low, high = balance.skeleton, *np.radians(LIMITS_DEG.T)
    for joint in range(20):
        digit, number = divmod(joint, 4)
        spring = STIFFNESS[joint] * (balance.command.angles[joint] - balance.angles[joint])
        beyond = balance.angles[joint] - np.clip(balance.angles[joint], low[joint], high[joint])
        expected = balance.command.torque[joint] + spring - LIMIT_NMM_PER_RAD * beyond
        for sphere in range(7 * digit, 7 * digit + 7):
            if balance.command.hand.sphere_capsules[sphere] % 3 >= number - 1:
                lever = touch[sphere] - skeleton.centres[digit, number]
                moment = np.cross(lever, balance.forces[sphere], axis=0)
                expected = expected + np.einsum("xn,xn->n", skeleton.axes[digit, number], moment)
        assert balance.on_joints[joint] == pytest.approx(expected, abs=1e-7)


def test_residuals_are_what_skin_and_weight_leave_without_the_soft_spring(balance: Balance) -> None:
    touch = balance.levers
    force = balance.command.weight - sum(balance.forces[s] for s in range(50))
    moment = -sum(np.cross(touch[s], balance.forces[s], axis=0) for s in range(50))
    assert balance.residual_n == pytest.approx(np.linalg.norm(force, axis=0), rel=1e-9)
    assert balance.residual_nmm == pytest.approx(np.linalg.norm(moment, axis=0), rel=1e-9)


@pytest.mark.parametrize("sticks", [1.0, 2.0])
def test_no_skin_is_dragged_harder_than_friction_allows(balance: Balance, sticks: float) -> None:
    further = moved(balance, np.full((20, 4), 0.01), np.full((6, 4), 0.02), sticks)
    across = np.einsum("mxn,mxn->mn", further.forces, further.normal)
    sideways = np.linalg.norm(further.forces - across[:, None] * further.normal, axis=1)
    assert across == pytest.approx(further.presses, abs=1e-9)
    limit = sticks * balance.skin.friction * further.presses
    assert (sideways <= limit * (1.0 + 1e-9) + 1e-9).all()
    assert (sideways > 0.999 * limit)[further.presses > 0.1].any()  # and some of it slips


def test_letting_go_what_slips_changes_no_force(balance: Balance) -> None:
    let_go = replace(balance.command, object_points=balance.slipped())
    after = Balance(let_go, balance.skin, balance.angles, balance.pose)
    assert after.forces == pytest.approx(balance.forces, abs=1e-6)
    assert after.on_joints == pytest.approx(balance.on_joints, abs=1e-4)


def test_skin_off_the_object_forgets_what_it_stuck_to(balance: Balance) -> None:
    let_go = replace(balance.command, object_points=balance.slipped())
    after = Balance(let_go, balance.skin, balance.angles, balance.pose)
    off = balance.presses == 0.0
    assert off.any()
    assert np.linalg.norm(after.dragged, axis=1)[off] == pytest.approx(0.0, abs=1e-9)


def test_without_friction_skin_only_presses(balance: Balance) -> None:
    slippery = Balance(balance.command, replace(balance.skin, friction=0.0), balance.angles, balance.pose)
    assert slippery.forces == pytest.approx(slippery.presses[:, None] * slippery.normal, abs=1e-9)


SHAPES: tuple[Shape, ...] = (Sphere(60.0), Cylinder(30.0, 120.0), Box(80.0, 20.0, 40.0))
GIVEN = st.lists(st.tuples(st.sampled_from(SHAPES), st.integers(1, 3)), min_size=1, max_size=5)


def scattered(n: int) -> tuple[Pose, np.ndarray]:
    draw = np.random.default_rng(n)
    numbers = np.concatenate([draw.uniform(-50.0, 50.0, (3, n)), draw.uniform(-2.0, 2.0, (3, n))])
    return Pose.of(numbers), draw.uniform(-80.0, 80.0, (6, 3, n))


@given(GIVEN)
def test_each_repetition_meets_its_own_object(asked: list[tuple[Shape, int]]) -> None:
    shapes, counts = [shape for shape, _ in asked], [count for _, count in asked]
    pose, points = scattered(sum(counts))
    distance, normal, curvature = surfaces(shapes, counts).at(pose, points)
    whose = [shape for shape, count in asked for _ in range(count)]
    for one, shape in enumerate(whose):
        alone, place = Pose(pose.position[:, [one]], pose.rotation[..., [one]]), points[..., [one]]
        known_distance, known_normal = alone.distance(shape, place)
        assert np.array_equal(distance[:, [one]], known_distance)
        assert np.array_equal(normal[..., [one]], known_normal)
        assert np.array_equal(curvature[:, [one]], shape.curvature(alone.inward(place)))


@given(GIVEN, st.data())
def test_some_rows_keep_their_objects(asked: list[tuple[Shape, int]], data: st.DataObject) -> None:
    found = surfaces([shape for shape, _ in asked], [count for _, count in asked])
    n = len(found.whose)
    kept = np.flatnonzero(data.draw(st.lists(st.booleans(), min_size=n, max_size=n).filter(any)))
    pose, points = scattered(n)
    whole = found.at(pose, points)
    part = found.rows(kept).at(Pose(pose.position[:, kept], pose.rotation[..., kept]), points[..., kept])
    for all_rows, some in zip(whole, part, strict=True):
        assert np.array_equal(all_rows[..., kept], some)


@given(GIVEN)
def test_bars_are_told_from_what_bends_both_ways(asked: list[tuple[Shape, int]]) -> None:
    found = surfaces([shape for shape, _ in asked], [count for _, count in asked]).bars()
    whose = [shape for shape, count in asked for _ in range(count)]
    assert found.tolist() == [float(isinstance(shape, Cylinder)) for shape in whose]


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
    told = command([make_load(by_grasp[grasp]) for grasp in ("PoS", "Tip", "CMF")])
    hand, skeleton = told.hand, told.hand.skeleton(told.angles)
    of_skin = skeleton.origins[hand.sphere_capsules] + turned(skeleton.frames[hand.sphere_capsules], told.skin_points)
    of_object = told.pose.outward(told.object_points) + told.pose.position
    assert of_skin == pytest.approx(of_object, abs=1e-10)
    from_middle = np.linalg.norm(of_skin - hand.spheres(skeleton), axis=1)
    assert from_middle == pytest.approx(np.broadcast_to(hand.sphere_radii[:, None], from_middle.shape), rel=1e-9)


def test_weight_pulls_down_with_mass(by_grasp: dict[str, Condition]) -> None:
    condition = by_grasp["PoS"]
    weight = command([make_load(condition, 4)]).weight
    assert weight == pytest.approx(np.tile(condition.held.down[:, None] * condition.thing.mass_kg * 9.80665, 4))


def test_torque_is_that_of_the_grip(by_grasp: dict[str, Condition]) -> None:
    load = make_load(by_grasp["Tip"], 4)
    unit = torques(load.condition, load.condition.hand.skeleton(load.angles), Pose.of(load.pose.T))
    assert command([load]).torque == pytest.approx(unit * load.grip_n)
