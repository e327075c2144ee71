"""contact.mujoco: the hand of hand.py in MuJoCo, springs and skin as asked, no grasp kept that did not rest."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.simulator.body.condition import Condition, Held, Pad, Thing
from thenar.simulator.body.hand import CAPSULES, DOF, LIMITS_DEG, Hand, Size
from thenar.simulator.body.layout import murakami160
from thenar.simulator.body.shapes import Box, Cylinder, Pose, Shape, Sphere
from thenar.simulator.contact.model import GRAVITY, STIFFNESS, Contact, Load, torques
from thenar.simulator.contact.mujoco import Dynamics, MujocoContact, build
from thenar.simulator.effects.contact_mujoco import Parameters, model
from thenar.simulator.pipeline.effect import Setting

SIZES = st.builds(Size, length_mm=st.floats(150.0, 220.0), breadth_mm=st.floats(65.0, 100.0))
ANGLES = arrays(np.float64, 20, elements=st.floats(0.0, 1.0)).map(
    lambda share: np.radians(LIMITS_DEG[:, 0] + share * (LIMITS_DEG[:, 1] - LIMITS_DEG[:, 0]))
)
BALL = Sphere(diameter_mm=70.0)
SHAPES = (BALL, Cylinder(diameter_mm=60.0, length_mm=90.0), Box(60.0, 60.0, 60.0))
# Fingers round a ball below them, order of DOF.
ROUND_IT_DEG = np.array([40.0, 10.0, 20.0, 20.0] + [0.0, 35.0, 40.0, 25.0] * 4)
BELOW = np.array([95.0, 5.0, -50.0, 0.0, 0.0, 0.0])
OUT_OF_REACH = np.array([900.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def dynamics(**changes: float) -> Dynamics:
    given = msgspec.structs.asdict(Parameters(**changes))  # type: ignore[arg-type]
    del given["after"]
    return Dynamics(**given)


WELD_N_PER_MM = Parameters().weld_n_per_m / 1e3
TIPS = tuple(Pad(7 * digit + 6, 0.2) for digit in range(5))


def holding(shape: Shape = BALL, pose: np.ndarray = BELOW, mass_kg: float = 0.2) -> Condition:
    held = Held(ROUND_IT_DEG, pose, TIPS, 10.0)
    return Condition("A", Hand(Size(185.0, 83.0)), "CMF", Thing("thing", shape, mass_kg), held)


def told(condition: Condition, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return n commands around the held posture."""
    rng = np.random.default_rng(11)
    posture_deg = condition.held.posture_deg + rng.normal(0.0, 1.5, (n, 20))
    pose = condition.held.pose + rng.normal(0.0, 1.0, (n, 6)) * [1.5, 1.5, 1.5, 0.04, 0.04, 0.04]
    return posture_deg, pose, condition.held.grip_n * rng.uniform(0.7, 1.4, n)


@pytest.fixture(scope="module")
def solve(make_setting: Callable[..., Setting]) -> Callable[..., Contact]:
    """Return a function that closes n hands, under parameters of its own."""

    def solve(condition: Condition, n: int = 4, **parameters: Any) -> Contact:
        return model(Parameters(**parameters), make_setting()).solve([Load(condition, *told(condition, n))])[0]

    return solve


ARRAYS = tuple(field for field in Contact.__slots__ if field != "steps")


def picked(contact: Contact, rows: list[int]) -> Contact:
    return replace(contact, **{field: getattr(contact, field)[rows] for field in ARRAYS})


def same(a: Contact, b: Contact) -> bool:
    return all(np.array_equal(getattr(a, field), getattr(b, field)) for field in ARRAYS)


@given(SIZES, ANGLES)
@settings(max_examples=30)
def test_every_part_lies_where_the_hand_says(size: Size, angles: np.ndarray) -> None:
    hand = Hand(size)
    bodies = build(hand, holding().thing, dynamics())
    data = mujoco.MjData(bodies)
    data.qpos[:20] = angles
    mujoco.mj_kinematics(bodies, data)
    skeleton = hand.skeleton(angles[:, None])
    for number, capsule in enumerate(CAPSULES):
        geom, origin, axis = data.geom(capsule), skeleton.origins[number, :, 0], skeleton.frames[number, :, 0, 0]
        # A capsule's middle lies on the segment's axis, at half of what it spans.
        along = (geom.xpos * 1e3 - origin) @ axis
        assert 0.0 < along < hand.lengths[number]
        assert geom.xpos * 1e3 == pytest.approx(origin + along * axis, abs=1e-9)
        assert np.abs(geom.xmat.reshape(3, 3)[:, 2] @ axis) == pytest.approx(1.0, abs=1e-12)
        assert bodies.geom(capsule).size[0] * 1e3 == pytest.approx(hand.radii[number])
    for number in range(15):
        frame = data.body(CAPSULES[number]).xmat.reshape(3, 3)
        assert frame == pytest.approx(skeleton.frames[number, :, :, 0], abs=1e-12)
        assert data.body(CAPSULES[number]).xpos * 1e3 == pytest.approx(skeleton.origins[number, :, 0], abs=1e-9)


@pytest.mark.parametrize("digit", range(5))
def test_a_digit_ends_where_its_last_sphere_of_skin_does(digit: int) -> None:
    hand = Hand(Size(185.0, 83.0))
    bodies = build(hand, holding().thing, dynamics())
    tip = bodies.geom(CAPSULES[3 * digit + 2])
    last = np.flatnonzero(hand.sphere_capsules == 3 * digit + 2)[-1]
    assert (tip.pos[0] + tip.size[1]) * 1e3 == pytest.approx(hand.sphere_offsets[last])


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_the_object_has_its_shape_and_lies_as_its_pose_says(shape: Shape) -> None:
    bodies = build(Hand(Size(185.0, 83.0)), Thing("thing", shape, 0.1), dynamics())
    thing = bodies.geom("object")
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, thing.quat)
    half = {Sphere: thing.size[[0, 0, 0]], Cylinder: thing.size[[0, 0, 1]], Box: thing.size}[type(shape)]
    assert np.abs(turn.reshape(3, 3) @ half) * 2e3 == pytest.approx(np.array(shape.extent_mm()))


def test_an_unloaded_joint_returns_to_its_commanded_angle() -> None:
    bodies = build(holding().hand, holding().thing, dynamics())
    data = mujoco.MjData(bodies)
    bodies.qpos_spring[:20] = np.radians(ROUND_IT_DEG)
    data.qpos[:20] = np.radians(ROUND_IT_DEG + np.resize([8.0, -8.0], 20))
    data.qpos[20] = bodies.qpos_spring[20] = 0.9
    mujoco.mj_step(bodies, data, Parameters().steps)
    assert np.degrees(data.qpos[:20]) == pytest.approx(ROUND_IT_DEG, abs=0.05)


def test_a_joint_that_only_its_muscle_turns_gives_by_torque_over_stiffness(solve: Callable[..., Contact]) -> None:
    condition = holding(pose=OUT_OF_REACH)
    posture_deg, pose, grip_n = told(condition, 4)
    skeleton = condition.hand.skeleton(np.radians(posture_deg.T))
    expected = torques(condition, skeleton, Pose.of(pose.T)) * grip_n / STIFFNESS[:, None]
    found = solve(condition)
    assert np.radians(found.posture_deg - posture_deg) == pytest.approx(expected.T, rel=0.02, abs=2e-3)
    assert not found.capsules_n.any()
    assert found.settled.all()


def test_an_object_that_nothing_holds_hangs_on_its_weld(solve: Callable[..., Contact]) -> None:
    condition = holding(pose=OUT_OF_REACH, mass_kg=0.4)
    down = np.array([0.0, 0.6, -0.8])
    condition = replace(condition, held=replace(condition.held, down=down))
    sunk_mm = solve(condition).pose[:, :3] - told(condition, 4)[1][:, :3]
    assert sunk_mm == pytest.approx(np.tile(0.4 * GRAVITY / WELD_N_PER_MM * down, (4, 1)), abs=1e-4)


@pytest.mark.parametrize("skin_n_per_mm", [1.0, 2.0, 5.0])
def test_skin_gives_by_force_over_stiffness(solve: Callable[..., Contact], skin_n_per_mm: float) -> None:
    condition = holding()
    hand = condition.hand
    found = solve(condition, steps=400, skin_n_per_mm=skin_n_per_mm)
    skeleton = hand.skeleton(np.radians(found.posture_deg.T))
    # How deep each digit's segment lies in the ball, by the distance of the ball's middle from the segment's axis.
    away = found.pose.T[:3] - skeleton.origins[:15]
    reach = np.where(np.arange(15) % 3 == 2, 0.62, 1.0) * hand.lengths[:15]
    along = np.clip((away * skeleton.frames[:15, :, 0]).sum(axis=1), 0.0, reach[:, None])
    off = np.linalg.norm(away - along[:, None] * skeleton.frames[:15, :, 0], axis=1)
    depth_mm = np.maximum(hand.radii[:15, None] + 35.0 - off, 0.0)
    assert (found.capsules_n[:, :15] > 0.5).sum() > 8
    assert found.capsules_n.T[:15] == pytest.approx(skin_n_per_mm * depth_mm, abs=0.1)


def test_forces_and_moments_on_the_object_balance(
    solve: Callable[..., Contact], make_condition: Callable[..., Condition]
) -> None:
    for condition, steps, left_n, left_nmm in (
        (holding(), 60, 0.1, 5.0),
        (holding(), 400, 0.03, 1.0),
        (make_condition(), 400, 0.1, 2.0),
    ):
        found = solve(condition, steps=steps)
        assert found.settled.all()
        assert (found.capsules_n.sum(axis=1) > 5.0).all()
        assert found.residual_n.max() < left_n
        assert found.residual_nmm.max() < left_nmm


def test_the_switches_bear_what_the_capsules_do(solve: Callable[..., Contact]) -> None:
    found = solve(holding())
    assert found.forces_n.sum(axis=1) + found.between_n == pytest.approx(found.capsules_n.sum(axis=1))
    assert found.forces_n.shape == (4, 160)


def test_a_switch_shares_in_the_force_as_far_as_the_glove_reaches(solve: Callable[..., Contact]) -> None:
    short, far = solve(holding(), reach_mm=0.0), solve(holding(), reach_mm=2.0)
    assert np.array_equal(short.capsules_n, far.capsules_n)
    assert ((far.forces_n > 0.0) >= (short.forces_n > 0.0)).all()
    assert (far.forces_n > 0.0).sum() > (short.forces_n > 0.0).sum()
    assert (far.between_n <= short.between_n).all()


def test_a_rough_object_is_held_where_a_smooth_one_slips(solve: Callable[..., Contact]) -> None:
    # Nothing but skin holds it.
    alone = {"weld_n_per_m": 20.0, "weld_nm_per_rad": 0.05, "steps": 100}
    condition = holding(mass_kg=0.3)
    rough, smooth = (solve(condition, friction=friction, **alone).pose[:, 1] for friction in (1.0, 0.01))
    assert (rough - smooth > 1.0).all()


def test_a_grasp_alone_equals_itself_in_a_batch(make_setting: Callable[..., Setting]) -> None:
    condition = holding()
    contact = model(Parameters(), make_setting())
    commands = told(condition, 5)
    together = contact.solve([Load(condition, *commands)])[0]
    for one in range(5):
        alone = contact.solve([Load(condition, *(command[[one]] for command in commands))])[0]
        assert same(alone, picked(together, [one]))


def test_a_grasp_after_others_equals_itself_before_them(make_setting: Callable[..., Setting]) -> None:
    condition = holding()
    contact = model(Parameters(), make_setting())
    commands = told(condition, 4)
    back = contact.solve([Load(condition, *(command[::-1] for command in commands))])[0]
    forth = contact.solve([Load(condition, *commands)])[0]
    assert same(forth, picked(back, [3, 2, 1, 0]))


@pytest.mark.parametrize("dt_ms", [50.0, 100.0])
def test_steps_too_long_are_reported_and_nothing_of_them_is_kept(
    solve: Callable[..., Contact],
    dt_ms: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    condition = holding()
    found = solve(condition, dt_ms=dt_ms)
    assert not found.settled.any()
    posture_deg, pose, _ = told(condition, 4)
    assert found.posture_deg == pytest.approx(posture_deg)
    assert np.array_equal(found.pose, pose)
    assert not found.forces_n.any()
    assert np.isinf(found.residual_n).all()
    # MuJoCo neither wrote to the console nor left its log in the working folder.
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())


def test_a_grasp_read_before_it_rests_is_reported(solve: Callable[..., Contact]) -> None:
    found = solve(holding(), steps=8)
    assert not found.settled.any()
    assert np.isfinite(found.residual_n).all()


def test_a_hand_that_still_moves_is_reported_though_its_object_rests(solve: Callable[..., Contact]) -> None:
    condition = holding(pose=OUT_OF_REACH, mass_kg=0.001)
    assert (solve(condition, steps=6).residual_n < 0.05).all()
    assert not solve(condition, steps=6).settled.any()
    assert solve(condition, steps=60).settled.all()


def test_an_object_that_still_moves_is_reported_though_all_forces_on_it_balance() -> None:
    # So soft a hold hardly damps: what was pushed once turns on.
    condition = holding(mass_kg=0.3)
    load = Load(condition, *told(condition, 12))
    now, then = (
        MujocoContact(dynamics(weld_n_per_m=20.0, weld_nm_per_rad=0.005, steps=steps), murakami160()).solve([load])[0]
        for steps in (200, 202)
    )
    # In 10 ms it turns by 0.001 rad at 0.1 rad/s, and slides by 0.03 mm at 3 mm/s.
    moving = (np.abs(now.pose - then.pose) > [0.06, 0.06, 0.06, 0.002, 0.002, 0.002]).any(axis=1)
    assert (moving & (now.residual_n < 0.1 + 0.02 * now.capsules_n.sum(axis=1))).any()
    assert not now.settled[moving].any()


@pytest.mark.parametrize("size", [5e-324, 1e-12, 1e-9])
def test_objects_of_next_to_no_size_are_something_to_mujoco(solve: Callable[..., Contact], size: float) -> None:
    for shape in (Sphere(size), Cylinder(40.0, size, 0.0), Box(80.0, 50.0, size, 0.0)):
        found = solve(holding(shape), 1)
        assert np.isfinite(found.capsules_n).all()
        assert np.isfinite(found.residual_n).all()


def test_a_hand_of_a_hundredth_is_built_and_one_of_full_size_stays_as_it_is() -> None:
    small, whole = (build(Hand(Size(185.0 * s, 83.0 * s)), holding().thing, dynamics()) for s in (0.01, 1.0))
    assert small.body_mass[1:].min() >= 1e-12
    assert whole.body_mass[1:16].min() > 1e-3
    assert whole.body_inertia[1:16].min() > 1e-8


def test_the_longest_step_a_scene_may_ask_for_is_too_long_for_the_stiffest_skin(solve: Callable[..., Contact]) -> None:
    assert not solve(holding(), dt_ms=10.0, skin_n_per_mm=20.0).settled.any()


def test_what_goes_wrong_stays_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo leaves its log here
    bodies = build(holding().hand, holding().thing, dynamics())
    data = mujoco.MjData(bodies)
    data.qpos[3] = np.nan
    mujoco.mj_step(bodies, data)
    assert np.isnan(data.qpos[3])
    assert data.warning.number.any()


def test_no_part_of_the_hand_meets_another() -> None:
    bodies = build(holding().hand, holding(pose=OUT_OF_REACH).thing, dynamics())
    data = mujoco.MjData(bodies)
    data.qpos[:20] = np.radians(np.array([60.0, 50.0, 60.0, 60.0] + [0.0, 90.0, 100.0, 80.0] * 4))  # a fist
    data.qpos[20] = 0.9
    mujoco.mj_forward(bodies, data)
    assert data.ncon == 0


def test_a_joint_stops_at_its_range() -> None:
    bodies = build(holding().hand, holding().thing, dynamics())
    assert np.degrees(bodies.jnt_range[:20]) == pytest.approx(LIMITS_DEG)
    assert bodies.jnt_limited[:20].all()
    assert [bodies.joint(number).name for number in range(20)] == list(DOF)


def test_steps_are_counted(make_setting: Callable[..., Setting]) -> None:
    (contact,) = model(Parameters(steps=60), make_setting()).solve([Load(holding(), *told(holding(), 3))])
    assert contact.steps == 3 * 60


WITHOUT_MUJOCO = """
import sys
sys.modules["mujoco"] = None
from thenar.drivers.extras import MissingPackageError
from thenar.simulator.pipeline.effect import EFFECTS
effect = EFFECTS["contact.mujoco"]
parameters = effect.parameters(steps=3)
try:
    effect.model(parameters, None)
except MissingPackageError as wrong:
    print(wrong)
"""


def test_where_mujoco_is_missing_a_scene_is_read_and_its_run_says_what_to_install() -> None:
    ran = subprocess.run([sys.executable, "-c", WITHOUT_MUJOCO], capture_output=True, text=True, check=True)
    assert ran.stdout == 'contact.mujoco: mujoco is not installed: pip install "thenar[sim]"\n'
