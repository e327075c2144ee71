import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.errors import SettingError
from thenar.drivers.names import fault
from thenar.runtime.calibration import load_calibration

from ..drivers.test_calibration import LINES

CALIBRATIONS = st.builds(
    lambda subject, lines: GloveCalibration(subject=subject, sensors=tuple(lines)),
    st.text().filter(lambda name: not name or not fault(name)),
    st.lists(LINES, unique_by=lambda line: line.name, max_size=5),
)
SENSOR = '{ name = "index_mpj", raw_a = 96, value_a = 0.0, raw_b = 161, value_b = 90.0 }'


@pytest.mark.parametrize("values", [(0.0, math.inf), (math.nan, 90.0)])
def test_values_are_finite_numbers(values: tuple[float, float]) -> None:
    with pytest.raises(SettingError, match="'index_mpj': value_a and value_b must be finite numbers"):
        SensorCalibration("index_mpj", 96, values[0], 161, values[1])


@given(CALIBRATIONS)
def test_a_file_gives_back_every_digit(tmp_path_factory: pytest.TempPathFactory, calibration: GloveCalibration) -> None:
    path = tmp_path_factory.getbasetemp() / "digits.toml"
    path.write_text(calibration.to_toml(), "utf-8")
    assert load_calibration(path) == calibration


def test_a_file_is_as_its_docstring_shows_it(tmp_path: Path) -> None:
    path = tmp_path / "anna.toml"
    path.write_text(f'subject = "anna"\nunit = "deg"\nsensor = [\n    {SENSOR},\n]\n')
    calibration = load_calibration(path)
    assert calibration == GloveCalibration(
        subject="anna", sensors=(SensorCalibration("index_mpj", 96, 0.0, 161, 90.0),)
    )
    assert calibration.to_toml() == path.read_text()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("subject = ", "not valid TOML: Invalid value"),
        ('subject = "anna"', "line 1: the key sensor is missing"),
        (f"sensor = [{SENSOR}]\nunit = 'rad'", "line 2: unit: 'rad' is not among its values"),
        (f"sensor = [{SENSOR}]\nhand = 'left'", "line 2: hand: this key is unknown"),
        (f"sensor = [{SENSOR}, {SENSOR}]", "'index_mpj' is calibrated twice"),
        (f"sensor = [{SENSOR.replace('96', '0')}]", r"sensor\[0\]\.raw_a: must be at (least|most)"),
        (f"sensor = [{SENSOR.replace('96', '256')}]", r"sensor\[0\]\.raw_a: must be at (least|most)"),
        (f"sensor = [{SENSOR.replace('96', '161')}]", r"sensor\[0\]: 'index_mpj': raw_a and raw_b are both 161"),
        (f"sensor = [{SENSOR.replace('90.0', 'inf')}]", r"sensor\[0\]\.value_b: must be a finite number, not inf"),
        (
            f"sensor = [{', '.join(SENSOR.replace('index', str(n)) for n in (*range(12_000), 7))}]",
            "'7_mpj' is calibrated twice",
        ),
        (f"sensor = [{SENSOR.replace('index_mpj', '')}]", r"sensor\[0\]\.name"),
    ],
)
def test_a_wrong_file_is_named_with_what_is_wrong(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    with pytest.raises(SettingError, match=rf"wrong\.toml.*{complaint}"):
        load_calibration(path)


@pytest.mark.parametrize("name", ["", "\x1b[2J", "a\u202eb", "two\nlines", "s" * 201])
def test_a_name_that_would_deceive_or_get_lost_is_refused(tmp_path: Path, name: str) -> None:
    line = SensorCalibration("index_mpj", 96, 0.0, 161, 90.0)
    text = GloveCalibration(subject="anna", sensors=(line,)).to_toml()
    for good in ("anna", "index_mpj")[not name :]:  # no subject is given in many files
        (tmp_path / "anna.toml").write_text(text.replace(f'"{good}"', json.dumps(name)))
        with pytest.raises(SettingError, match=r"must be text of length|holds a control character|at most 200"):
            load_calibration(tmp_path / "anna.toml")
