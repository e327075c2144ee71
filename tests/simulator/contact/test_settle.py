"""Arrow systems against numpy's solver; the stiffness matrix against finite differences of the forces.

The matrix leaves out what would make it unsymmetric or indefinite: how dragged skin resists as it sinks in deeper, how
points of contact wander, how edges and ends bend, and how levers turn with what they press (all in proportion to the
pressing force, against skin's stiffness). It is held to the differences exactly where these vanish, and loosely on
planned grasps.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thenar.simulator.body.condition import Condition, Pad, PlannedGrasp, Thing
from thenar.simulator.body.hand import LIMITS_DEG, Hand, Size
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere
from thenar.simulator.contact.balance import Balance, Skin, command
from thenar.simulator.contact.model import Load
from thenar.simulator.contact.settle import newton_step, solve_arrow, stiffness

from ..small import make_load

HAND = Hand(Size(185.0, 83.0))
HARD = Skin(press_n_per_mm=3.0, soft_mm=1e-4, drag_n_per_mm=1.5, friction=2.0)
ROUND = (Sphere(60.0), Cylinder(50.0, 400.0), Box(60.0, 60.0, 30.0))


def matrix(balance: Balance) -> np.ndarray:
    """Return the whole matrix (26, 26) of the only repetition."""
    joints, coupling, body = (block[..., 0] for block in stiffness(balance))
    whole = np.zeros((26, 26))
    for digit in range(5):
        own = slice(4 * digit, 4 * digit + 4)
        whole[own, own], whole[own, 20:], whole[20:, own] = joints[digit], coupling[digit], coupling[digit].T
    whole[20:, 20:] = body
    return whole


def differences(balance: Balance, step: float = 1e-6) -> np.ndarray:
    """Return minus the change of all forces (26, 26) with all unknowns, by central differences."""
    columns = []
    for unknown in range(26):
        ends = []
        for way in (step, -step):
            change = np.zeros((26, 1))
            change[unknown] = way
            moved = Balance(
                balance.command, balance.skin, balance.angles + change[:20], balance.pose.moved(change[20:]), 2.0
            )
            ends.append(np.concatenate([moved.on_joints, moved.on_object])[:, 0])
        columns.append(-(ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, axis=1)


def scaled(whole: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Return a matrix in units of the square roots of the diagonal of `like`."""
    root = np.sqrt(np.diag(like))
    return whole / root[:, None] / root[None]


def touched(sphere: int, shape: Shape, angles: np.ndarray, way: np.ndarray, sunk: float, skin: Skin) -> Balance:
    """Return a hand that meets an object with one sphere of skin, which sinks in by `sunk` mm on its side `way`."""
    centre = HAND.spheres(HAND.skeleton(angles[:, None]))[sphere, :, 0]
    # The object's own z looks back at the sphere, from wherever it is.
    side = np.cross([0.3, 0.5, -0.8], -way)
    side /= np.linalg.norm(side)
    axes = np.stack([side, np.cross(-way, side), -way], axis=1)
    depth = shape.extent_mm()[2] / 2 + HAND.sphere_radii[sphere] - sunk
    pose = np.concatenate([centre + depth * way, Rotation.from_matrix(axes).as_rotvec()])
    held = PlannedGrasp(np.degrees(angles), pose, (Pad(sphere, 1.0),), 0.0)
    condition = Condition("A", HAND, "touch", Thing("thing", shape, 0.0), held)
    told = command([Load(condition, np.degrees(angles)[None], pose[None], np.zeros(1))])
    return Balance(told, skin, told.angles, told.pose, 2.0)


def touches(shape: Shape, sunk: float, skin: Skin) -> Iterator[Balance]:
    """Yield hands in many postures that meet an object with one sphere of skin and with nothing else."""
    draw = np.random.default_rng(3)
    for sphere in draw.permutation(np.repeat(np.arange(50), 12)):
        way = draw.normal(size=3) * [1.0, 1.0, 0.3] - [0.0, 0.0, 2.0]  # below the hand, where its skin is
        balance = touched(sphere, shape, draw.uniform(0.05, 0.7, 20), way / np.linalg.norm(way), sunk, skin)
        if (np.delete(balance.sunk[:, 0], sphere) < -0.01).all():
            yield balance


@pytest.mark.slow
@pytest.mark.parametrize("shape", ROUND, ids=lambda shape: type(shape).__name__)
def test_a_light_touch_is_resisted_exactly_as_differences_say(shape: Shape) -> None:
    found = list(islice(touches(shape, 1e-3, HARD), 15))
    assert len(found) >= 10
    for balance in found:
        ours = matrix(balance)
        assert scaled(ours, ours) == pytest.approx(scaled(differences(balance, 1e-7), ours), abs=2e-3)


@pytest.mark.parametrize("shape", ROUND, ids=lambda shape: type(shape).__name__)
def test_shifting_an_object_is_resisted_exactly_even_where_its_surface_bends(shape: Shape) -> None:
    found = list(islice(touches(shape, 2.0, HARD), 15))
    assert len(found) >= 10
    for balance in found:
        assert matrix(balance)[20:23, 20:23] == pytest.approx(differences(balance)[20:23, 20:23], abs=1e-4)
    straight = isinstance(shape, Box)
    assert all((balance.bent > 0.0).any() != straight for balance in found)


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["kamakura", "cutkosky"])
def test_on_planned_grasps_the_matrix_is_near_the_differences(
    scene: str, planned: dict[str, tuple[Condition, ...]], skin: Skin
) -> None:
    off = []
    for condition in planned[scene]:
        load = make_load(condition, 1, share=0.0)
        # Joints planned to their limits stand on a kink: a hair within, they do not.
        within = np.clip(load.posture_deg, LIMITS_DEG[:, 0] + 0.1, LIMITS_DEG[:, 1] - 0.1)
        told = command([replace(load, posture_deg=within)])
        balance = Balance(told, skin, told.angles, told.pose, 2.0)
        found = matrix(balance)
        off.append(np.linalg.norm(scaled(found - differences(balance), found), ord=2))
    # Largest deviation in any direction, in units of the matrix itself.
    assert np.median(off) < 0.05
    assert max(off) < 0.3


def test_the_matrix_is_positive_definite_on_planned_grasps(
    planned: dict[str, tuple[Condition, ...]], skin: Skin
) -> None:
    for condition in (*planned["kamakura"], *planned["cutkosky"]):
        told = command([make_load(condition, 1)])
        assert np.linalg.eigvalsh(matrix(Balance(told, skin, told.angles, told.pose)))[0] > 0.0


def test_a_step_solves_the_matrix_or_a_part_of_it(planned: dict[str, tuple[Condition, ...]], skin: Skin) -> None:
    for condition in planned["kamakura"]:
        told = command([make_load(condition, 1)])
        balance = Balance(told, skin, told.angles, told.pose)
        whole = np.linalg.solve(matrix(balance), np.concatenate([balance.on_joints, balance.on_object])[:, 0])
        step = newton_step(balance)[:, 0]
        share = step @ whole / (whole @ whole)
        assert 0.0 < share <= 1.0 + 1e-9
        assert step == pytest.approx(share * whole, rel=1e-6, abs=1e-9 * np.abs(whole).max())


def test_no_step_is_longer_than_joints_and_objects_may_move_at_once(
    planned: dict[str, tuple[Condition, ...]], skin: Skin
) -> None:
    for condition in planned["cutkosky"]:
        told = command([make_load(condition, 8, share=3.0)])
        step = np.abs(newton_step(Balance(told, skin, told.angles, told.pose)))
        assert step[:20].max() <= 0.12 + 1e-12
        assert step[20:23].max() <= 3.0 + 1e-12
        assert step[23:].max() <= 0.12 + 1e-12


SEEDS = st.integers(0, 10_000)
SCALES = st.floats(-3.0, 4.0).map(lambda power: 10.0**power)


def arrow(seed: int, n: int, scale: float = 1.0) -> tuple[np.ndarray, ...]:
    """Return positive definite systems of five limbs and one body: the five parts that `solve_arrow` takes."""
    draw = np.random.default_rng(seed)
    # Each limb with the body is a Gram matrix; their sum is one too, and a little on the diagonal makes it definite.
    rows = draw.normal(size=(5, 12, 10, n)) * np.sqrt(scale)
    gram = np.einsum("drin,drjn->dijn", rows, rows)
    limbs, coupling, body = gram[:, :4, :4], gram[:, :4, 4:], gram[:, 4:, 4:].sum(axis=0)
    limbs[:, np.arange(4), np.arange(4)] += 0.1
    body[np.arange(6), np.arange(6)] += 0.1
    return limbs, coupling, body, draw.normal(size=(5, 4, n)), draw.normal(size=(6, n))


def dense(limbs: np.ndarray, coupling: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Return the same systems (n, 26, 26)."""
    whole = np.zeros((limbs.shape[-1], 26, 26))
    for limb in range(5):
        own = slice(4 * limb, 4 * limb + 4)
        whole[:, own, own] = np.moveaxis(limbs[limb], -1, 0)
        whole[:, own, 20:] = np.moveaxis(coupling[limb], -1, 0)
        whole[:, 20:, own] = whole[:, own, 20:].swapaxes(1, 2)
    whole[:, 20:, 20:] = np.moveaxis(body, -1, 0)
    return whole


@given(SEEDS, st.integers(1, 5), SCALES)
def test_arrow_systems_are_solved_as_numpy_solves_them(seed: int, n: int, scale: float) -> None:
    limbs, coupling, body, on_limbs, on_body = arrow(seed, n, scale)
    right = np.concatenate([on_limbs.reshape(20, n), on_body])
    found = solve_arrow(limbs, coupling, body, on_limbs, on_body)
    whole = dense(limbs, coupling, body)
    known = np.linalg.solve(whole, right.T[..., None])[..., 0].T
    condition = np.linalg.cond(whole).max()
    assert found == pytest.approx(known, rel=1e-14 * condition, abs=1e-14 * condition * np.abs(known).max())
