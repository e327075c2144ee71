"""What a posture is measured by before it is one: where an object starts, and how pads share a push."""

from itertools import product

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.simulator.body.hand import Hand, Size
from thenar.simulator.body.shapes import Box, Cylinder, Pose, Shape, Sphere
from thenar.simulator.planning.plan import shipped_prehensions
from thenar.simulator.planning.planner import Misfit, object_start, shares, wrenches
from thenar.simulator.planning.prehension import Prehension

HAND = Hand(Size(188.0, 84.0))
TIP = shipped_prehensions("kamakura14")["Tip"]
BOX = Box(length_mm=60.0, width_mm=40.0, height_mm=20.0)
WAYS = [tuple(sign * float(x) for x in row) for row in np.eye(3) for sign in (1, -1)]


def turned(prehension: Prehension, **changes: object) -> Prehension:
    return msgspec.structs.replace(prehension, **changes)


@pytest.mark.parametrize(("axis", "up"), [(a, u) for a, u in product(WAYS, WAYS) if np.cross(a, u).any()])
def test_an_object_starts_with_its_own_axes_where_the_table_points_them(axis: tuple, up: tuple) -> None:
    start = object_start(HAND, turned(TIP, axis=axis, up=up), BOX)
    x, _, z = Pose.of(start[:, None]).rotation[:, :, 0].T
    # A box is the same after half a turn.
    assert abs(x @ axis) == pytest.approx(1.0)
    assert abs(z @ up) == pytest.approx(1.0)


@pytest.mark.parametrize("shape", [Sphere(50.0), Cylinder(30.0, 120.0), BOX], ids=lambda shape: type(shape).__name__)
@pytest.mark.parametrize("away", WAYS)
def test_an_object_starts_with_its_surface_at_the_point_of_the_table(shape: Shape, away: tuple) -> None:
    start = object_start(HAND, turned(TIP, axis=(0, 1, 0), up=(0, 0, 1), away=away), shape)
    point = np.array(TIP.at) * [188.0, 84.0, 84.0]
    distance, normal = Pose.of(start[:, None]).distance(shape, point[None, :, None])
    assert distance[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert normal[0, :, 0] == pytest.approx(-np.array(away), abs=1e-9)


def test_up_need_not_lie_square_to_the_axis() -> None:
    square, leaning = (object_start(HAND, turned(TIP, axis=(0, 2, 0), up=up), BOX) for up in ((0, 0, 1), (0, 5, 1)))
    assert leaning == pytest.approx(square)


@settings(deadline=None)  # the first call loads scipy
@given(arrays(np.float64, st.tuples(st.just(6), st.integers(1, 12)), elements=st.floats(-2.0, 2.0)))
def test_shares_of_a_push_are_none_negative_and_sum_to_one(wrench: np.ndarray) -> None:
    found, left = shares(wrench)
    assert found.min() >= 0.0
    assert found.sum() == pytest.approx(1.0)
    assert left == pytest.approx(wrench @ found)


def test_two_pads_on_the_two_sides_of_a_thing_push_alike_and_leave_nothing() -> None:
    normals, levers = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 10.0], [0.0, 0.0, -10.0]])
    found, left = shares(wrenches(normals, levers))
    assert found == pytest.approx([0.5, 0.5])
    assert left == pytest.approx(np.zeros(6), abs=1e-12)


def test_two_pads_on_one_side_leave_the_whole_push() -> None:
    found, left = shares(wrenches(np.array([[0.0, 0.0, 1.0]] * 2), np.array([[10.0, 0.0, 5.0], [-10.0, 0.0, 5.0]])))
    assert found == pytest.approx([0.5, 0.5])
    assert left == pytest.approx([0.0, 0.0, -1.0, 0.0, 0.0, 0.0], abs=1e-12)


def test_a_candidate_has_the_same_residuals_in_any_company() -> None:
    misfit = Misfit(HAND, TIP, Sphere(12.0))
    random = np.random.default_rng(5)
    many = np.concatenate([misfit.nominal, np.zeros(6)])[:, None] + random.normal(scale=0.05, size=(26, 7))
    alone = np.concatenate([misfit.residuals(many[:, k : k + 1]) for k in range(7)], axis=1)
    assert np.array_equal(misfit.residuals(many), alone)
