"""The force on a capsule is shared among its switches by depth, and none is lost."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.simulator.body.hand import CAPSULES, Hand, Size
from thenar.simulator.body.layout import SwitchPlaces, murakami160
from thenar.simulator.contact.model import split

SWITCHES = SwitchPlaces(Hand(Size(185.0, 83.0)), murakami160())
N_SWITCHES = len(SWITCHES.capsules)
# Many at the surface and outside, so that capsules of which no switch, one or all touch come up.
DEPTHS_MM = st.sampled_from((-5.0, -1e-9, 0.0)) | st.floats(1e-15, 10.0)


@st.composite
def pressed(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    n = draw(st.integers(1, 3))
    depths = draw(arrays(np.float64, (N_SWITCHES, n), elements=DEPTHS_MM, fill=DEPTHS_MM))
    forces = draw(arrays(np.float64, (len(CAPSULES), n), elements=st.floats(0.0, 100.0)))
    return depths, forces


@given(pressed())
def test_each_capsule_keeps_its_own_force(case: tuple[np.ndarray, np.ndarray]) -> None:
    depths, forces = case
    shared, _ = split(SWITCHES, depths, forces)
    for capsule, force in enumerate(forces):
        own = SWITCHES.capsules == capsule
        touched = (depths[own] > 0.0).any(axis=0)
        assert shared[own].sum(axis=0) == pytest.approx(np.where(touched, force, 0.0), rel=1e-12)


@given(pressed())
def test_within_a_capsule_force_is_in_proportion_to_depth(case: tuple[np.ndarray, np.ndarray]) -> None:
    depths, forces = case
    shared, _ = split(SWITCHES, depths, forces)
    sunk = np.maximum(depths, 0.0)
    for capsule in range(len(CAPSULES)):
        own = SWITCHES.capsules == capsule
        deepest, most = sunk[own].max(axis=0), shared[own].max(axis=0)
        assert shared[own] * deepest == pytest.approx(sunk[own] * most, rel=1e-9, abs=1e-12)


@given(st.sampled_from((5e-324, 1e-310, 1e-300)), st.sampled_from((5e-324, 1.0, 1e300)))
def test_tiny_depths_share_the_force(depth: float, force: float) -> None:
    depths = np.full((N_SWITCHES, 1), -1.0)
    depths[:2] = depth
    forces = np.zeros((len(CAPSULES), 1))
    forces[SWITCHES.capsules[0]] = force
    shared, between = split(SWITCHES, depths, forces)
    assert shared[:2].sum() == pytest.approx(force, rel=1e-15)
    assert shared[0, 0] == shared[1, 0] or force == 5e-324
    assert not between.any()
