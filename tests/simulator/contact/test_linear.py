"""Arrow systems against numpy's solver, and each alone against itself in company."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.contact.settle import solve_arrow

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
