from fractions import Fraction

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.errors import SettingError
from thenar.runtime.calibration import CodeTables, codes_of_bytes
from thenar.runtime.errors import FrameError
from thenar.runtime.manifest import Calibration

values = st.floats(-1e4, 1e4) | st.sampled_from([0.0, 90.0, 0.25, -0.25])
codes = st.integers(0, 65535)
raws = st.integers(1, 255)


def joint(
    name: str = "a", code_a: int = 0, value_a: float = 0.0, code_b: int = 1000, value_b: float = 500.0
) -> Calibration:
    return Calibration(0, name, "deg", code_a, value_a, code_b, value_b)


def raw_joint(name: str) -> Calibration:
    return Calibration(0, name, "raw", 1, 1.0, 255, 255.0)


@given(a=codes, b=codes, value_a=values, value_b=values, raw_a=raws, raw_b=raws, low=values, high=values)
def test_a_bytes_code_lies_on_the_calibrations_line(
    a: int, b: int, value_a: float, value_b: float, raw_a: int, raw_b: int, low: float, high: float
) -> None:
    assume(raw_a != raw_b and a != b and value_a != value_b)
    coded = joint("a", a, value_a, b, value_b)
    calibration = GloveCalibration(subject="anna", sensors=(SensorCalibration("a", raw_a, low, raw_b, high),))
    # In 2^-24 of a code.
    step = (value_b - value_a) / (b - a)
    assume(step)
    ends = [a + (value - value_a) / step for value in (low, high)]
    if max(map(abs, ends)) >= 2**20:
        with pytest.raises(SettingError, match=r"far beyond|not a number"):
            codes_of_bytes(coded, calibration)
        return
    first, last = (Fraction(round(end * 2**24), 2**24) for end in ends)
    line = [first + (last - first) * Fraction(raw - raw_a, raw_b - raw_a) for raw in range(256)]
    assert codes_of_bytes(coded, calibration) == tuple(min(max(round(code), 0), 65535) for code in line)


@pytest.mark.parametrize(
    ("names", "expected"), [([], []), (["b"], [20]), (["b", "b2"], [20, 40]), (["c", "a"], [30, 10])]
)
def test_joints_are_picked_by_name_wherever_they_stand_on_the_wire(names: list[str], expected: list[int]) -> None:
    tables = CodeTables([raw_joint(name) for name in names], ["a", "b", "c", "b2"])
    assert tables.codes(bytes([10, 20, 30, 40])) == expected


def test_halves_are_rounded_to_even_as_the_import_does() -> None:
    sensor = SensorCalibration("a", 1, 0.25, 3, 1.25)
    tables = CodeTables([joint(value_b=500.0)], ["a"], GloveCalibration(subject="anna", sensors=(sensor,)))
    assert [tables.codes(bytes([raw]))[0] for raw in (1, 2, 3)] == [0, 2, 2]


def test_bytes_are_codes_only_where_the_build_was_trained_on_bytes() -> None:
    assert CodeTables([raw_joint("a")], ["a"]).codes(b"\xff") == [255]
    for other in (joint(), joint(code_a=1, code_b=256), joint(code_a=0, code_b=255), joint(code_a=7, code_b=7)):
        with pytest.raises(SettingError, match=r"not in the glove's bytes: calibrate it"):
            CodeTables([other], ["a"])


def test_a_joint_that_the_glove_lacks_is_named_with_the_nearest() -> None:
    with pytest.raises(SettingError, match=r"joint 'index_dij'.*did you mean 'index_pij'"):
        CodeTables([raw_joint("index_dij")], ["thumb_roll", "index_pij"])


def test_a_calibration_that_does_not_fit_is_refused() -> None:
    calibration = GloveCalibration(subject="anna", sensors=(SensorCalibration("b", 1, 0.0, 2, 1.0),))
    with pytest.raises(SettingError, match="has no sensor 'a'"):
        CodeTables([joint()], ["a"], calibration)
    with pytest.raises(SettingError, match=r"in 'deg', joint 'b' of the build in 'raw'"):
        CodeTables([raw_joint("b")], ["b"], calibration)


def test_points_of_a_build_that_are_no_line_are_refused() -> None:
    calibration = GloveCalibration(subject="anna", sensors=(SensorCalibration("a", 1, 0.0, 2, 1.0),))
    for flat in (joint(value_b=0.0), joint(code_b=0)):
        with pytest.raises(SettingError, match="make no line"):
            CodeTables([flat], ["a"], calibration)


def test_a_line_beyond_the_doubles_is_refused() -> None:
    steep = GloveCalibration(subject="anna", sensors=(SensorCalibration("a", 1, -1e308, 2, 1e308),))
    with pytest.raises(SettingError, match="is far beyond"):
        CodeTables([joint()], ["a"], steep)


@pytest.mark.parametrize("length", [0, 1, 3])
def test_a_record_of_another_length_is_refused(length: int) -> None:
    with pytest.raises(FrameError, match=f"record has {length} sensors, but 2 are named"):
        CodeTables([raw_joint("a")], ["a", "b"]).codes(bytes(length))
