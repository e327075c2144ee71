from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from thenar.compiler.hand import HandShape, MapError
from thenar.drivers.errors import ThenarError
from thenar.simulator.body.layout import Switches, murakami160
from thenar.simulator.handmaps.handmap import HAND, PARTS, RADIUS_MM, hand_map, rays, smooth

Floats = NDArray[np.float64]
DIGITS = range(5)


@pytest.fixture(scope="module")
def glove() -> HandShape:
    return hand_map()


def inside(points: Floats, polygon: Floats) -> NDArray[np.bool_]:
    """Return which points (n, 2) lie in a closed polygon (k, 2): a ray leaves it an odd number of times."""
    (x0, y0), (x1, y1) = polygon.T, np.roll(polygon, -1, axis=0).T
    x, y = points[:, 0, None], points[:, 1, None]
    spans = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    odd: NDArray[np.bool_] = (spans & (x < crossing)).sum(axis=1) % 2 == 1
    return odd


def rim(centre: Floats) -> Floats:
    turn = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    circle: Floats = centre + RADIUS_MM * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return circle


def distances(places: Floats) -> Floats:
    """Return the distances of all pairs of places (s, d)."""
    apart: Floats = np.sqrt(((places[:, None] - places[None]) ** 2).sum(axis=-1))
    return apart[np.triu_indices(len(places), 1)]


def on_the_hand() -> Floats:
    """Return where the switches of the flat, neutral hand lie in space (s, 3)."""
    return Switches(HAND, murakami160()).tops(HAND.skeleton(np.zeros((20, 1))))[:, :, 0]


def test_every_switch_of_the_layout_has_one_place_in_its_order(glove: HandShape) -> None:
    assert glove.names == tuple(patch.name for patch in murakami160())
    assert glove.places.shape == (160, 2)
    assert np.isfinite(glove.places).all()
    assert np.bincount(glove.parts).tolist() == [26, 26, 26, 26, 26, 30]
    assert [PARTS[part] for part in glove.parts] == [name.split("_")[0] for name in glove.names]


def test_no_two_switches_overlap(glove: HandShape) -> None:
    assert distances(glove.places).min() > 2 * RADIUS_MM


@pytest.mark.parametrize("digit", DIGITS)
def test_the_whole_circle_of_a_pad_lies_inside_its_digit_or_the_palm_below_it(glove: HandShape, digit: int) -> None:
    mine = np.flatnonzero((glove.parts == digit) & (glove.sides == 0))
    assert len(mine) == [20, 16, 16, 16, 16][digit]
    ray = rays()[digit]
    for switch in mine:
        # A finger's outline begins where it leaves the palm; the ball of the thumb is of the palm's outline.
        beyond_the_web = (glove.places[switch] - ray.base) @ ray.ahead > (0.3 if digit else 1.2) * ray.joints[1]
        outline = glove.digits[digit] if beyond_the_web else glove.outline
        assert inside(rim(glove.places[switch]), outline).all(), glove.names[switch]


@pytest.mark.parametrize("digit", DIGITS)
@pytest.mark.parametrize("side", [-1, 1])
def test_the_whole_circle_of_a_side_lies_on_its_strip_outside_the_skin(glove: HandShape, digit: int, side: int) -> None:
    mine = glove.places[(glove.parts == digit) & (glove.sides == side)]
    assert len(mine) == (5 if digit else {-1: 2, 1: 4}[side])
    strip = glove.strips[2 * digit + (side + 1) // 2]
    rims = np.concatenate(list(map(rim, mine)))
    assert inside(rims, strip).all()
    assert not inside(rims, glove.outline).any()
    assert not inside(strip, glove.outline).any()


def test_no_strip_covers_another(glove: HandShape) -> None:
    for number, strip in enumerate(glove.strips):
        for other in glove.strips[:number] + glove.strips[number + 1 :]:
            assert not inside(strip, other).any()


def test_the_palms_switches_lie_in_the_palm(glove: HandShape) -> None:
    palm = glove.places[glove.parts == 5]
    assert inside(np.concatenate(list(map(rim, palm))), glove.outline).all()
    assert not any(inside(palm, digit).any() for digit in glove.digits)


def test_it_is_a_right_hand_seen_from_its_palm(glove: HandShape) -> None:
    thumb, index, middle, ring, little = (glove.places[glove.parts == digit].mean(axis=0) for digit in DIGITS)
    assert little[0] < ring[0] < middle[0] < index[0] < thumb[0]
    assert thumb[1] < little[1] < middle[1]
    tips = [glove.places[glove.names.index(f"{digit}_distal_6"), 1] for digit in PARTS[:5]]
    roots = [glove.places[glove.names.index(f"{digit}_proximal_1"), 1] for digit in PARTS[:5]]
    assert all(tip > root for tip, root in zip(tips, roots, strict=True))


@pytest.mark.parametrize("finger", PARTS[1:5])
@pytest.mark.parametrize("segment", ["proximal", "middle", "distal"])
def test_radial_sides_lie_on_the_thumbs_side_of_their_finger(glove: HandShape, finger: str, segment: str) -> None:
    mine = np.array([name.startswith(f"{finger}_{segment}_") for name in glove.names])
    radial, left_to_right = on_the_hand()[:, 1], glove.places[:, 0]
    left, right = mine & (glove.sides == -1), mine & (glove.sides == 1)
    assert radial[left].max() < radial[right].min()
    assert left_to_right[left].max() < left_to_right[right].min()


@pytest.mark.parametrize("digit", DIGITS)
def test_around_a_digit_is_left_to_right_on_paper(glove: HandShape, digit: int) -> None:
    ray = rays()[digit]
    across = (glove.places - ray.base) @ [ray.ahead[1], -ray.ahead[0]]
    for capsule in range(3 * digit, 3 * digit + 3):
        mine = [n for n, patch in enumerate(murakami160()) if patch.capsule == capsule and patch.along >= 0]
        around = np.array([murakami160()[n].around_deg for n in mine])
        assert np.corrcoef(around, across[mine])[0, 1] > 0.97
        pads = np.array(mine)[np.abs(around) < 75]
        assert np.allclose(across[pads].mean(), 0.0, atol=1e-9)
        assert np.corrcoef(np.array([murakami160()[n].around_deg for n in pads]), across[pads])[0, 1] > 0.99


def test_what_is_near_on_the_hand_is_near_on_paper(glove: HandShape) -> None:
    hand, paper = distances(on_the_hand()), distances(glove.places)
    assert np.corrcoef(hand, paper)[0, 1] > 0.9


@pytest.mark.parametrize("part", range(6))
def test_neighbours_within_a_part_stay_neighbours(glove: HandShape, part: int) -> None:
    mine = (glove.parts == part) & (glove.sides == 0)
    hand, paper = distances(on_the_hand()[mine]), distances(glove.places[mine])
    assert np.corrcoef(hand, paper)[0, 1] > 0.9


def test_segments_follow_each_other_up_a_finger(glove: HandShape) -> None:
    for digit, ray in zip(PARTS[:5], rays(), strict=True):
        numbers = [number for number, name in enumerate(glove.names) if name.startswith(f"{digit}_")]
        along = (glove.places[numbers] - ray.base) @ ray.ahead
        segments = np.array([name.split("_")[1] for name in glove.names])[numbers]
        order = [along[segments == segment] for segment in dict.fromkeys(segments.tolist())]
        assert all(low.max() < high.min() for low, high in pairwise(order))


def test_labels_stand_outside_the_hand(glove: HandShape) -> None:
    assert not inside(glove.labels, glove.outline).any()


def test_a_soft_curve_goes_through_its_points_and_a_straight_one_stays_straight() -> None:
    points = np.array([[0.0, 0.0], [3.0, 1.0], [4.0, 5.0], [2.0, 6.0]])
    curve = smooth(points)
    assert np.array_equal(curve[::12], points)
    line = smooth(np.outer(np.arange(5.0), [2.0, 1.0]))
    assert np.allclose(line[:, 0], 2 * line[:, 1])
    assert (np.diff(line[:, 0]) > 0).all()


def test_names_are_found_in_any_order(glove: HandShape) -> None:
    assert glove.numbers_of(["palm_heel_6", "thumb_metacarpal_1"]).tolist() == [159, 0]
    assert glove.numbers_of([]).tolist() == []


def test_the_first_strange_name_is_told_with_the_nearest(glove: HandShape) -> None:
    with pytest.raises(
        MapError, match=r"'index_distl_1' is no switch of the glove murakami160 \(did you mean 'index_d"
    ):
        glove.numbers_of(["palm_heel_6", "index_distl_1", "nonsense"])
    assert issubclass(MapError, ThenarError)
