"""The grid: sums are exact integers, in any order, and rounding costs at most half a unit a number."""

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.elementary import on_grids

MAGNITUDES = st.floats(-1e12, 1e12) | st.floats(-1e-300, 1e-300) | st.just(0.0) | st.floats(-1.0, 1.0)
ROWS = arrays(np.float64, st.tuples(st.integers(1, 3), st.integers(1, 40)), elements=MAGNITUDES)


@given(ROWS)
def test_numbers_become_integers_whose_sum_no_order_can_change(values: np.ndarray) -> None:
    integers = on_grids(values)[0].units
    assert (integers == np.rint(integers)).all()
    for row in integers:
        exact = sum(int(v) for v in row)
        assert sum(abs(int(v)) for v in row) <= 2**52
        assert float(row.sum()) == exact == float(row[::-1].cumsum()[-1])


@given(ROWS)
def test_every_number_moves_by_at_most_half_a_unit(values: np.ndarray) -> None:
    grid, _ = on_grids(values)
    integers, exponents = grid.units, grid.exponents
    for row, rounded, exponent in zip(values, integers, exponents, strict=True):
        unit = Fraction(2) ** -int(exponent)
        for v, i in zip(row, rounded, strict=True):
            assert abs(Fraction(float(v)) - int(i) * unit) <= unit / 2


@given(ROWS)
def test_the_units_are_as_fine_as_the_sum_allows(values: np.ndarray) -> None:
    integers = on_grids(values)[0].units
    for row, rounded in zip(values, integers, strict=True):
        if np.abs(row).max() > 1e-290:
            # The coarse sum may be one bit too high by rounding, and n/2 units are left as room: 2^50 less 20 units.
            assert sum(abs(int(v)) for v in rounded) >= 2**50 - 20


@given(ROWS, st.integers(-30, 30))
def test_scaling_by_a_power_of_two_changes_no_integer(values: np.ndarray, power: int) -> None:
    values = np.where(np.abs(values) < 1e-250, 0.0, values)
    grid, _ = on_grids(values)
    integers, exponents = grid.units, grid.exponents
    scaled, _ = on_grids(np.ldexp(values, power))
    assert np.array_equal(integers, scaled.units)
    assert (scaled.exponents[values.any(axis=1)] == exponents[values.any(axis=1)] - power).all()


@given(ROWS, st.integers(0, 2**32))
def test_the_sums_of_branches_are_exact_whatever_their_share(values: np.ndarray, seed: int) -> None:
    side = np.random.default_rng(seed).integers(0, 3, size=values.shape)
    grid, _ = on_grids(values)
    got = grid.branch_sums((side == 0).astype(float), (side == 2).astype(float), grid.exponents)
    assert got.shape == (3, len(values))
    for branch in range(3):
        for row in range(len(values)):
            exact = sum(Fraction(float(v)) for v in grid.units[row, side[row] == branch])
            assert Fraction(float(got[branch, row])) == exact
