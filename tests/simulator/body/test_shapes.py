"""Distances against brute force, normals and curvatures against derivatives, poses against scipy's rotations."""

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from thenar.simulator.body.shapes import Box, Cylinder, Pose, Shape, Sphere, rotation, rotation_vector

STEP = 1e-5
SPHERES = st.builds(Sphere, diameter_mm=st.floats(4.0, 120.0))


@st.composite
def bars(draw: st.DrawFn) -> Cylinder:
    diameter, length = draw(st.floats(4.0, 120.0)), draw(st.floats(2.0, 200.0))
    return Cylinder(diameter, length, draw(st.floats(0.0, 0.5)) * min(diameter, length))


@st.composite
def boxes(draw: st.DrawFn) -> Box:
    length, width, height = (draw(st.floats(2.0, 150.0)) for _ in range(3))
    return Box(length, width, height, draw(st.floats(0.0, 0.5)) * min(length, width, height))


SHAPES = st.one_of(SPHERES, bars(), boxes())
POINTS = arrays(np.float64, 3, elements=st.floats(-150.0, 150.0))


def at(shape: Shape, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distances (m,) and normals (m, 3) at points (m, 3)."""
    distance, normal = shape.distance(points[..., None])
    return distance[..., 0], normal[..., 0]


def nearest_in_core(shape: Shape, point: np.ndarray) -> np.ndarray:
    """Return the nearest point of the core that `edge_mm` of rounding wraps; a ball's is its middle."""
    match shape:
        case Sphere():
            return np.zeros(3)
        case Cylinder():
            along, across = shape.length_mm / 2 - shape.edge_mm, shape.diameter_mm / 2 - shape.edge_mm
            radius = np.hypot(point[1], point[2])
            shrink = across / radius if radius > across else 1.0
            return np.array([np.clip(point[0], -along, along), point[1] * shrink, point[2] * shrink])
        case Box():
            inner = np.array(shape.extent_mm()) / 2 - shape.edge_mm
            nearest: np.ndarray = np.clip(point, -inner, inner)
            return nearest


def wrap(shape: Shape) -> float:
    return shape.diameter_mm / 2 if isinstance(shape, Sphere) else shape.edge_mm


@given(SHAPES, POINTS)
def test_outside_the_distance_is_that_to_the_core_less_its_wrapping(shape: Shape, point: np.ndarray) -> None:
    gap = np.linalg.norm(point - nearest_in_core(shape, point))
    assume(gap > 1e-6)
    assert at(shape, point[None])[0][0] == pytest.approx(gap - wrap(shape), abs=1e-9)


@given(SHAPES, POINTS)
def test_outside_no_point_of_the_surface_is_nearer(shape: Shape, point: np.ndarray) -> None:
    distance, normal = (values[0] for values in at(shape, point[None]))
    assume(distance > 1e-3)
    foot = point - distance * normal
    assert at(shape, foot[None])[0][0] == pytest.approx(0.0, abs=1e-8)
    # All over the surface: seeds, brought down on it by their own distances.
    seeds = np.random.default_rng(3).normal(size=(2000, 3)) * shape.extent_mm()
    for _ in range(30):
        far, out = at(shape, seeds)
        seeds = seeds - far[:, None] * out
    surface = seeds[np.abs(at(shape, seeds)[0]) < 1e-8]
    assert len(surface) > 1000
    assert np.linalg.norm(surface - point, axis=1).min() > distance - 1e-7


@given(SHAPES)
def test_inside_the_distance_is_how_far_the_nearest_side_is(shape: Shape) -> None:
    inside = np.random.default_rng(5).uniform(-0.5, 0.5, (50, 3)) * shape.extent_mm()
    distance, normal = at(shape, inside)
    deep = distance < -wrap(shape) if not isinstance(shape, Sphere) else distance < 0.0
    if isinstance(shape, Box):
        sides = (np.abs(inside) - np.array(shape.extent_mm()) / 2).max(axis=1)
    elif isinstance(shape, Cylinder):
        radius = np.hypot(inside[:, 1], inside[:, 2])
        sides = np.maximum(np.abs(inside[:, 0]) - shape.length_mm / 2, radius - shape.diameter_mm / 2)
    else:
        sides = np.linalg.norm(inside, axis=1) - shape.diameter_mm / 2
    assert distance[deep] == pytest.approx(sides[deep], abs=1e-9)
    out = inside - distance[:, None] * normal
    assert at(shape, out[deep])[0] == pytest.approx(0.0, abs=1e-8)


@given(SHAPES, POINTS, st.booleans(), st.sampled_from((0.0, 5e-324, 1e-200, 1e-155, 1e-149, 1e-15, 1e-12, 1e-9, 1e-3)))
def test_normals_are_of_unit_length_a_hair_off_the_core_too(
    shape: Shape, point: np.ndarray, off_the_core: bool, hair: float
) -> None:
    if off_the_core:
        point = nearest_in_core(shape, point) + hair * np.sign(point)
    assert np.linalg.norm(at(shape, point[None])[1]) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("hair", [0.0, 5e-324, 1e-200, 1e-13])
@pytest.mark.parametrize(
    "shape", [Sphere(8.0), Cylinder(8.0, 90.0), Box(9.0, 9.0, 9.0, 4.5)], ids=["ball", "bar", "die"]
)
def test_in_the_very_middle_one_way_out_is_chosen(shape: Shape, hair: float) -> None:
    distance, normal = at(shape, np.array([[hair, hair, -hair]]))
    assert distance[0] == pytest.approx(-min(shape.extent_mm()) / 2, abs=1e-12)
    assert np.linalg.norm(normal[0]) == pytest.approx(1.0, abs=1e-15)


def test_a_very_thin_disk_presses_as_a_thicker_one() -> None:
    above = np.array([[6e-15, 3.0, 4.0]])
    ways = [at(Cylinder(40.0, thin, 0.0), above)[1][0] for thin in (5e-324, 1e-16, 1e-15, 1e-14)]
    assert np.allclose(ways, [[1.0, 0.0, 0.0]] * 4, atol=1e-15)


@pytest.mark.parametrize("shape", [Cylinder(100.0, 10.0), Box(100.0, 100.0, 10.0, 0.0)], ids=["disk", "card"])
def test_the_mid_plane_of_a_flat_object_has_a_direction(shape: Shape) -> None:
    middle = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 2.0]])
    assert np.linalg.norm(at(shape, middle)[1], axis=1) == pytest.approx(1.0)


@given(SHAPES, POINTS)
def test_normals_are_the_gradient_of_distance(shape: Shape, point: np.ndarray) -> None:
    around = point + STEP * np.concatenate([np.eye(3), -np.eye(3)])
    distance, normals = at(shape, around)
    # On creases, where two sides are as near, there is no gradient.
    assume(np.linalg.norm(normals - normals[0], axis=1).max() < 0.01)
    slope = (distance[:3] - distance[3:]) / (2 * STEP)
    assert at(shape, point[None])[1][0] == pytest.approx(slope, abs=1e-5)


@given(SPHERES, POINTS)
def test_the_normals_of_a_ball_turn_as_its_curvature_says(ball: Sphere, point: np.ndarray) -> None:
    assume(np.linalg.norm(point) > 1.5)
    normal = at(ball, point[None])[1][0]
    side = np.cross(normal, np.roll(np.eye(3)[np.abs(normal).argmin()], 0))
    side /= np.linalg.norm(side)
    _, (there, back) = at(ball, point + STEP * np.array([side, -side]))
    assert (there - back) / (2 * STEP) == pytest.approx(ball.curvature(point[None, :, None])[0, 0] * side, abs=1e-5)


@given(bars(), st.floats(0.0, 1.0), st.floats(0.0, 60.0), st.floats(0.0, 2 * np.pi))
def test_the_normals_beside_a_bar_turn_across_it_and_not_along_it(
    bar: Cylinder, along: float, off: float, around: float
) -> None:
    half = bar.length_mm / 2 - bar.edge_mm
    assume(half > 0.1)
    radius = bar.diameter_mm / 2 + off
    out = np.array([0.0, np.cos(around), np.sin(around)])
    point = radius * out + (2 * along - 1) * 0.9 * half * np.eye(3)[0]
    across = np.cross(np.eye(3)[0], out)
    _, (there, back, on, behind) = at(bar, point + STEP * np.array([across, -across, np.eye(3)[0], -np.eye(3)[0]]))
    assert (there - back) / (2 * STEP) == pytest.approx(bar.curvature(point[None, :, None])[0, 0] * across, abs=1e-5)
    assert on == pytest.approx(behind, abs=1e-9)


@given(boxes(), bars(), POINTS)
def test_planes_do_not_bend(box: Box, bar: Cylinder, point: np.ndarray) -> None:
    assert not box.curvature(point[None, :, None]).any()
    beyond = np.array([bar.length_mm / 2 + 1.0, 0.1, 0.2])
    assert not bar.curvature(beyond[None, :, None]).any()


@given(SHAPES)
def test_nothing_reaches_beyond_the_extent_and_something_reaches_it(shape: Shape) -> None:
    for axis, size in enumerate(shape.extent_mm()):
        tip = np.eye(3)[axis] * size / 2
        assert at(shape, np.array([tip, -tip]))[0] == pytest.approx(0.0, abs=1e-9)


@given(SHAPES, arrays(np.float64, (3, 3, 6), elements=st.floats(-80.0, 80.0)))
def test_a_point_is_as_far_alone_as_in_company(shape: Shape, points: np.ndarray) -> None:
    distance, normal = shape.distance(points)
    curvature = shape.curvature(points)
    for one in range(6):
        alone = shape.distance(points[..., [one]])
        assert np.array_equal(alone[0][:, 0], distance[:, one])
        assert np.array_equal(alone[1][..., 0], normal[..., one])
        assert np.array_equal(shape.curvature(points[..., [one]])[:, 0], curvature[:, one])


@pytest.mark.parametrize(
    "content",
    [
        b'{"shape":"sphere","diameter_mm":-1}',
        b'{"shape":"cylinder","diameter_mm":0,"length_mm":1}',
        b'{"shape":"box","length_mm":9,"width_mm":9,"height_mm":3000}',
    ],
)
def test_impossible_sizes_are_refused(content: bytes) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(content, type=Shape)


def test_an_edge_rounder_than_the_object_is_refused_with_what_is_possible() -> None:
    with pytest.raises(ValueError, match=r"`edge_mm` 3.0 rounds off more than the object has: at most 2.5"):
        Box(20.0, 10.0, 5.0, 3.0)
    with pytest.raises(ValueError, match=r"at most 2\.0"):
        Cylinder(4.0, 100.0, 2.1)


def test_half_of_the_smallest_sizes_may_be_rounded_off_too() -> None:
    for size in (5e-324, 1.5e-323, 1e-310):
        assert Box(size, size, size, size / 2).edge_mm == size / 2


AXES = arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)).filter(lambda v: np.linalg.norm(v) > 0.1)
# Everything from nothing to half a turn, and closely by both.
TURNS = st.one_of(
    st.floats(0.0, np.pi),
    st.floats(-300.0, 0.0).map(lambda power: 10.0**power),
    st.floats(-16.0, -1.0).map(lambda power: np.pi - 10.0**power),
    st.just(np.pi),
)
VECTORS = st.builds(lambda axis, angle: axis / np.linalg.norm(axis) * angle, AXES, TURNS)
PLACES = arrays(np.float64, 3, elements=st.floats(-300.0, 300.0))
BOX = Box(length_mm=60.0, width_mm=30.0, height_mm=10.0)
BALL = Sphere(diameter_mm=40.0)


def pose_of(place: np.ndarray, vector: np.ndarray) -> Pose:
    return Pose.of(np.concatenate([place, vector])[:, None])


@given(VECTORS)
def test_a_rotation_is_scipys(vector: np.ndarray) -> None:
    assert rotation(vector[:, None])[..., 0] == pytest.approx(Rotation.from_rotvec(vector).as_matrix(), abs=1e-15)


@given(VECTORS)
def test_rotation_vectors_survive_their_matrices_up_to_half_a_turn(vector: np.ndarray) -> None:
    back = rotation_vector(rotation(vector[:, None]))[:, 0]
    # Half a turn one way is half a turn the other way.
    other = back - 2 * np.pi * back / max(float(np.linalg.norm(back)), 1e-300)
    assert min(np.abs(back - vector).max(), np.abs(other - vector).max()) < 4e-15


@given(AXES, st.floats(-150.0, -3.0).map(lambda power: 10.0**power))
def test_small_turns_keep_all_their_digits(axis: np.ndarray, angle: float) -> None:
    vector = axis / np.linalg.norm(axis) * angle
    assert rotation_vector(rotation(vector[:, None]))[:, 0] == pytest.approx(vector, rel=1e-14, abs=1e-15 * angle)


@given(arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_the_rotation_vector_of_any_matrix_is_scipys(quaternion: np.ndarray) -> None:
    known = Rotation.from_quat(quaternion)
    found = rotation_vector(known.as_matrix()[:, :, None])[:, 0]
    assert np.linalg.norm(found) <= np.pi + 1e-15
    assert Rotation.from_rotvec(found).as_matrix() == pytest.approx(known.as_matrix(), abs=1e-14)


@given(VECTORS, PLACES, arrays(np.float64, (4, 3, 1), elements=st.floats(-100.0, 100.0)))
def test_inward_undoes_outward(vector: np.ndarray, place: np.ndarray, points: np.ndarray) -> None:
    pose = pose_of(place, vector)
    assert pose.inward(pose.outward(points) + pose.position) == pytest.approx(points, abs=1e-12)


@given(VECTORS, PLACES, arrays(np.float64, (4, 3, 1), elements=st.floats(-100.0, 100.0)))
def test_outward_turns_as_scipy_does(vector: np.ndarray, place: np.ndarray, points: np.ndarray) -> None:
    known = Rotation.from_rotvec(vector).apply(points[..., 0])
    assert pose_of(place, vector).outward(points)[..., 0] == pytest.approx(known, abs=1e-12)


@given(VECTORS, PLACES, VECTORS, PLACES)
def test_poses_shift_and_turn_about_the_hands_axes(
    vector: np.ndarray, place: np.ndarray, turn: np.ndarray, shift: np.ndarray
) -> None:
    moved = pose_of(place, vector).moved(np.concatenate([shift, turn])[:, None])
    known = (Rotation.from_rotvec(turn) * Rotation.from_rotvec(vector)).as_matrix()
    assert moved.position[:, 0] == pytest.approx(place + shift, abs=1e-12)
    assert moved.rotation[..., 0] == pytest.approx(known, abs=1e-14)


@given(VECTORS, PLACES, arrays(np.float64, (4, 3, 1), elements=st.floats(-100.0, 100.0)))
def test_distance_ignores_common_motion_of_hand_and_object(
    vector: np.ndarray, place: np.ndarray, points: np.ndarray
) -> None:
    pose = pose_of(place, vector)
    seen = pose.outward(points) + pose.position
    assert pose.distance(BOX, seen)[0] == pytest.approx(BOX.distance(points)[0], abs=1e-11)
    off = points + np.array([0.0, 0.0, 200.0])[:, None]  # a ball has no creases, only a middle
    distance, normal = pose.distance(BALL, pose.outward(off) + pose.position)
    assert distance == pytest.approx(BALL.distance(off)[0], abs=1e-11)
    assert normal == pytest.approx(pose.outward(BALL.distance(off)[1]), abs=1e-11)
