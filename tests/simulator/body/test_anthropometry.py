"""A hand's parts follow from its length and breadth, in published proportions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.body.hand import BASES, DIGITS, RADII, SEGMENTS, Size

SIZES = st.builds(Size, length_mm=st.floats(150.0, 230.0), breadth_mm=st.floats(65.0, 105.0))
# Buchholz, Armstrong and Goldstein 1992, Table 2: segments over hand length, proximal to distal.
BUCHHOLZ = {
    "thumb": (0.251, 0.196, 0.158),
    "index": (0.245, 0.143, 0.097),
    "middle": (0.266, 0.170, 0.108),
    "ring": (0.244, 0.165, 0.107),
    "little": (0.204, 0.117, 0.093),
}


@given(SIZES)
def test_segments_are_as_published_times_the_length_of_the_hand(size: Size) -> None:
    expected = [[share * size.length_mm for share in BUCHHOLZ[digit]] for digit in DIGITS]
    assert size.segments_mm() == pytest.approx(np.array(expected), rel=1e-12)


@given(SIZES, st.floats(0.5, 2.0))
def test_hands_of_one_shape_are_alike(size: Size, scale: float) -> None:
    larger = Size(size.length_mm * scale, size.breadth_mm * scale)
    for measure in (Size.segments_mm, Size.bases_mm, Size.radii_mm):
        assert measure(larger) == pytest.approx(scale * measure(size), rel=1e-12)


@given(SIZES, st.floats(0.8, 1.2))
def test_a_broader_hand_is_thicker_and_not_longer(size: Size, scale: float) -> None:
    broader = Size(size.length_mm, size.breadth_mm * scale)
    assert np.array_equal(broader.segments_mm(), size.segments_mm())
    assert broader.radii_mm() == pytest.approx(scale * size.radii_mm(), rel=1e-12)


def test_fingers_thin_towards_their_tips() -> None:
    assert (np.diff(RADII, axis=1) < 0.0).all()


def test_the_longest_middle_finger_reaches_the_hands_length() -> None:
    reach = BASES[1:, 0] + SEGMENTS[1:].sum(axis=1)
    assert reach.argmax() == 1
    # A straight middle finger ends a hand: within a fingertip's half thickness.
    assert reach[1] == pytest.approx(1.0, abs=0.02)


def test_knuckles_stand_in_a_row_across_the_breadth_of_the_hand() -> None:
    across = BASES[1:, 1]
    assert (np.diff(across) < 0.0).all()
    assert 0.5 < across[0] - across[-1] < 0.8  # from axis to axis, without the outer halves of index and little finger
