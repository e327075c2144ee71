import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.calibration import SensorCalibration
from thenar.drivers.names import fault

VALUES = st.floats(-1e6, 1e6)
RAW = st.integers(1, 255)
LINES = st.builds(
    lambda name, raws, value_a, value_b: SensorCalibration(name, raws[0], value_a, raws[1], value_b),
    st.text().filter(lambda name: not fault(name)),
    st.lists(RAW, min_size=2, max_size=2, unique=True),
    VALUES,
    VALUES,
)


@given(LINES, RAW)
def test_a_line_goes_through_its_first_point_and_rises_by_one_stated_formula(line: SensorCalibration, raw: int) -> None:
    gain = (line.value_b - line.value_a) / (line.raw_b - line.raw_a)
    assert line.value(raw) == line.value_a + (raw - line.raw_a) * gain
    assert line.value(line.raw_a) == line.value_a
    assert line.value(line.raw_b) == pytest.approx(line.value_b, rel=1e-12, abs=1e-6)
