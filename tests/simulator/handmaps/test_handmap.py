import numpy as np
import pytest
from numpy.typing import NDArray

from thenar.compiler.hand import HandShape
from thenar.simulator.body.layout import SwitchPlaces, murakami160
from thenar.simulator.handmaps.handmap import HAND, PARTS, RADIUS_MM, hand_map, outlines, rays

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
    return SwitchPlaces(HAND, murakami160()).tops(HAND.skeleton(np.zeros((20, 1))))[:, :, 0]


def test_every_switch_of_the_layout_has_one_place_in_its_order(glove: HandShape) -> None:
    assert glove.names == tuple(patch.name for patch in murakami160())
    assert glove.places.shape == (160, 2)
    assert np.isfinite(glove.places).all()
    assert np.bincount(glove.parts).tolist() == [26, 26, 26, 26, 26, 30]
    assert [PARTS[part] for part in glove.parts] == [name.split("_")[0] for name in glove.names]


def test_no_two_switches_overlap(glove: HandShape) -> None:
    assert distances(glove.places).min() > 2 * RADIUS_MM


@pytest.mark.parametrize("digit", DIGITS)
def test_a_switchs_circle_lies_wholly_within_its_part(glove: HandShape, digit: int) -> None:
    ray, own = rays()[digit], outlines()[1][digit]
    for switch in np.flatnonzero(glove.parts == digit):
        place, side = glove.places[switch], glove.sides[switch]
        if side:
            strip = glove.strips[2 * digit + (side + 1) // 2]
            assert inside(rim(place), strip).all()
            assert not inside(np.concatenate([rim(place), strip]), glove.outline).any()
        else:
            # A finger's outline begins where it leaves the palm; the ball of the thumb is of the palm's outline.
            beyond_the_web = (place - ray.base) @ ray.ahead > (0.3 if digit else 1.2) * ray.joints[1]
            assert inside(rim(place), own if beyond_the_web else glove.outline).all()
    palm = glove.places[glove.parts == 5]
    assert inside(np.concatenate(list(map(rim, palm))), glove.outline).all()
    assert not inside(palm, own).any()


def test_it_is_a_right_hand_seen_from_its_palm(glove: HandShape) -> None:
    thumb, index, middle, ring, little = (glove.places[glove.parts == digit].mean(axis=0) for digit in DIGITS)
    assert little[0] < ring[0] < middle[0] < index[0] < thumb[0]
    assert thumb[1] < little[1] < middle[1]
    tips = [glove.places[glove.names.index(f"{digit}_distal_6"), 1] for digit in PARTS[:5]]
    roots = [glove.places[glove.names.index(f"{digit}_proximal_1"), 1] for digit in PARTS[:5]]
    assert all(tip > root for tip, root in zip(tips, roots, strict=True))


def test_what_is_near_on_the_hand_is_near_on_paper(glove: HandShape) -> None:
    hand, paper = distances(on_the_hand()), distances(glove.places)
    assert np.corrcoef(hand, paper)[0, 1] > 0.9
