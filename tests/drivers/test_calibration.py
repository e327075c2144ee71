from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.calibration import FLAT, POSES, Held, SensorCalibration, calibration, held, problems
from thenar.drivers.cyberglove_protocol import SENSORS_18, SENSORS_22
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
def test_a_line_passes_its_first_point_by_the_stated_formula(line: SensorCalibration, raw: int) -> None:
    gain = (line.value_b - line.value_a) / (line.raw_b - line.raw_a)
    assert line.value(raw) == line.value_a + (raw - line.raw_a) * gain
    assert line.value(line.raw_a) == line.value_a
    assert line.value(line.raw_b) == pytest.approx(line.value_b, rel=1e-12, abs=1e-6)


FIST = POSES[0]


def still(raw: bytes) -> Held:
    return Held(raw, (0,) * len(raw))


def with_bytes(**raw: int) -> Held:
    return still(bytes(raw.get(name, 100) for name in SENSORS_18))


def test_every_sensor_is_for_one_pose_besides_the_flat_hand() -> None:
    named = Counter(name for pose in POSES for name in pose.degrees)
    assert named == Counter(SENSORS_22)
    assert FLAT.degrees == {}


def test_a_held_pose_is_the_median_despite_glitches() -> None:
    assert held([b"\x64\x10", b"\x66\x10", b"\xff\x10", b"\x65\x10", b"\x65\x10"]) == Held(b"\x65\x10", (155, 0))
    assert held([b"\x01\xff"]) == Held(b"\x01\xff", (0, 0))


def test_a_good_pose_has_no_problems() -> None:
    bent = with_bytes(**dict.fromkeys(FIST.degrees, 110))
    assert problems(SENSORS_18, with_bytes(), FIST, bent) == []
    assert problems(SENSORS_18, None, FLAT, with_bytes()) == []


@pytest.mark.parametrize("raw", [100, 91, 109])
def test_an_unmoved_joint_is_a_problem_of_its_pose_only(raw: int) -> None:
    bent = with_bytes(**(dict.fromkeys(FIST.degrees, 150) | {"ring_pij": raw}))
    (problem,) = problems(SENSORS_18, with_bytes(), FIST, bent)
    assert problem.startswith(f"ring_pij went from 100 to {raw} only")
    assert not any("thumb" in problem for problem in problems(SENSORS_18, with_bytes(), FIST, with_bytes()))


@pytest.mark.parametrize("raw", [1, 255])
def test_a_sensor_at_the_end_of_its_range_is_a_problem(raw: int) -> None:
    (problem,) = problems(SENSORS_18, None, FLAT, with_bytes(palm_arch=raw))
    assert "palm_arch is at the end of its range" in problem


def test_a_hand_that_is_not_still_is_a_problem() -> None:
    restless = Held(with_bytes().raw, tuple(9 if name == "wrist_yaw" else 8 for name in SENSORS_18))
    assert problems(SENSORS_18, None, FLAT, restless) == ["wrist_yaw drifted by 9 counts: hold still"]


@pytest.mark.parametrize("names", [SENSORS_18, SENSORS_22])
def test_lines_go_through_the_flat_hand_and_the_pose_of_each_sensor(names: tuple[str, ...]) -> None:
    flat = still(bytes(range(60, 60 + len(names))))
    found = [(pose, still(bytes(range(100 + 10 * n, 100 + 10 * n + len(names))))) for n, pose in enumerate(POSES)]
    lines = calibration(names, flat, found, "anna")
    assert lines.subject == "anna"
    assert tuple(line.name for line in lines.sensors) == names
    for place, line in enumerate(lines.sensors):
        (number,) = [n for n, pose in enumerate(POSES) if line.name in pose.degrees]
        assert (line.raw_a, line.value_a) == (60 + place, 0.0)
        assert (line.raw_b, line.value_b) == (100 + 10 * number + place, POSES[number].degrees[line.name])


def test_a_sensor_that_did_not_move_at_all_gets_no_line() -> None:
    found = [(pose, with_bytes(**dict.fromkeys(pose.degrees, 150) | {"palm_arch": 100})) for pose in POSES]
    names = [line.name for line in calibration(SENSORS_18, with_bytes(), found, "").sensors]
    assert names == [name for name in SENSORS_18 if name != "palm_arch"]
