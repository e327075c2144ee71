import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.recordings import RecordingError, TableError
from thenar.compiler.recordings.columns import CalibrationPoints, JointColumns, sound_grid
from thenar.compiler.recordings.importer import code_joint

ANGLES = st.lists(st.floats(-400, 400), min_size=1, max_size=20)


def rows(values: np.ndarray) -> np.ndarray:
    return np.arange(2, len(values) + 2)


@given(ANGLES, st.sampled_from([0.1, 0.5, 1.0, 3.0]))
def test_no_value_moves_by_more_than_half_the_grid(angles: list[float], grid: float) -> None:
    values = np.array(angles)
    codes, joint, cost = code_joint("j", JointColumns(("j",), grid=grid), values, rows(values))
    errors = np.abs(joint.value(codes) - values)
    assert errors.max() <= grid / 2 + 1e-9
    assert cost.largest_error == errors.max()
    assert cost.rms_error == pytest.approx(float(np.sqrt(np.mean(errors**2))))
    assert cost.distinct_before == len(set(values.tolist()))
    assert cost.distinct_after == len(set(codes.tolist())) <= cost.distinct_before


@given(ANGLES)
def test_the_grid_starts_at_a_multiple_below_the_least_value(angles: list[float]) -> None:
    values = np.array(angles)
    codes, joint, _ = code_joint("j", JointColumns(("j",), grid=0.5), values, rows(values))
    assert joint.value_a <= values.min() < joint.value_a + 0.5
    assert joint.value_a % 0.5 == 0
    assert codes.min() in (0, 1)
    assert joint.step == 0.5


def test_codes_are_taken_as_they_are() -> None:
    values = np.array([1.0, 255.0, 65535.0])
    codes, joint, cost = code_joint("j", JointColumns(("j",), "raw", codes=True), values, rows(values))
    assert codes.tolist() == joint.value(codes).tolist() == values.tolist()
    assert cost.largest_error == 0


def test_values_are_coded_by_a_calibration_when_there_is_one() -> None:
    entry = JointColumns(("j",), calibration=CalibrationPoints(100, 0.0, 200, -90.0))
    codes, _, cost = code_joint("j", entry, np.array([0.0, -45.2, -90.0]), np.arange(3))
    assert codes.tolist() == [100, 150, 200]
    assert cost.largest_error == pytest.approx(0.2)
    assert cost.step == 0.9


@pytest.mark.parametrize(
    ("entry", "advice"),
    [
        (JointColumns(("j",), grid=0.001), "take a coarser grid"),
        (JointColumns(("j",), origin=1.0), "check origin and calibration"),
        (JointColumns(("j",), calibration=CalibrationPoints(0, 10.0, 1, 11.0)), "check origin and calibration"),
    ],
)
def test_values_beyond_the_codes_are_refused_with_their_rows(entry: JointColumns, advice: str) -> None:
    with pytest.raises(TableError, match=f"joint 'j': rows? .* would get codes outside 0..65535: {advice}"):
        code_joint("j", entry, np.array([0.0, 100.0, 5.0]), np.array([2, 3, 4]))


@pytest.mark.parametrize("values", [[0.0, 1e308], [-1e308, 1e308], [-1e308, 0.0], [1e308, 1e308]])
@pytest.mark.parametrize("grid", [0.5, 0.001])
def test_values_beyond_all_counting_are_refused_as_well(values: list[float], grid: float) -> None:
    with pytest.raises((TableError, RecordingError), match="take a coarser grid"):
        code_joint("j", JointColumns(("j",), grid=grid), np.array(values), np.arange(2))


@pytest.mark.parametrize("size", [1e-200, 1e-9, 1.0, 1e200])
def test_the_cost_of_coding_is_told_in_any_unit(size: float) -> None:
    values = np.array([0.0, 1.25, 2.5, 7.75]) * size
    _, _, cost = code_joint("j", JointColumns(("j",), grid=size), values, rows(values))
    assert cost.largest_error == pytest.approx(0.5 * size)
    assert cost.rms_error == pytest.approx(size * math.sqrt((0.25**2 + 0.5**2 + 0.25**2) / 4))


@given(st.lists(st.floats(-1e290, 1e290), min_size=1, max_size=30).map(np.array))
def test_a_sound_grid_gives_every_value_a_code(values: np.ndarray) -> None:
    grid = sound_grid(values)
    if np.ptp(values) > 0:
        codes, joint, _ = code_joint("j", JointColumns(("j",), grid=grid), values, rows(values))
        assert np.abs(joint.value(codes) - values).max() <= grid * 0.5001


@given(st.lists(st.integers(-5000, 5000), min_size=2, max_size=30, unique=True), st.integers(0, 4))
def test_decimals_keep_all_that_they_tell(numbers: list[int], digits: int) -> None:
    values = np.array([float(f"{number}e-{digits}") for number in numbers])
    codes, joint, cost = code_joint("j", JointColumns(("j",), grid=sound_grid(values)), values, rows(values))
    assert cost.distinct_after == len(numbers)
    assert joint.value(codes) == pytest.approx(values, abs=1e-9)


@pytest.mark.parametrize(("largest", "grid"), [(1.5, 0.001), (90.0, 0.05), (3.3, 0.002), (1.5e-6, 1e-9), (4e12, 2e9)])
def test_noise_gets_a_thousand_steps(largest: float, grid: float) -> None:
    values = np.random.default_rng(1).random(5000) * largest
    assert sound_grid(values) == grid
    outlier = np.append(values, 30 * largest)
    assert sound_grid(outlier) == grid
    assert (sound_grid(np.array([3.0])), sound_grid(np.array([2.0, 2.0]))) == (1.0, 1.0)
