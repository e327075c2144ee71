"""The surfaces of many objects at once are those of each alone."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.body.shapes import Box, Cylinder, Pose, Shape, Sphere
from thenar.simulator.contact.balance import surfaces

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
