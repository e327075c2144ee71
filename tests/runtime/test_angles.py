"""A record's bytes become angles in rad by the glove's calibration."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.errors import SettingError
from thenar.runtime.calibration import AngleReader

SENSORS = ("thumb_ab", "index_mpj", "palm_arch")
INDEX = SensorCalibration(name="index_mpj", raw_a=96, value_a=0.0, raw_b=161, value_b=90.0)
THUMB = SensorCalibration(name="thumb_ab", raw_a=200, value_a=-10.0, raw_b=40, value_b=50.0)


@given(st.binary(min_size=3, max_size=3))
def test_every_byte_is_on_its_sensors_line(sensors: bytes) -> None:
    found = AngleReader(SENSORS, GloveCalibration(subject="anna", sensors=(INDEX, THUMB))).angles(sensors)
    assert found.names == ("thumb_ab", "index_mpj")
    assert found.positions_rad == (math.radians(THUMB.value(sensors[0])), math.radians(INDEX.value(sensors[1])))


def test_a_calibration_of_another_glove_is_refused() -> None:
    with pytest.raises(SettingError, match="has none of the glove's sensors"):
        AngleReader(("wrist_pitch",), GloveCalibration(subject="anna", sensors=(INDEX,)))
