"""The CyberGlove: 20 joint angles, 18 sensors, their bytes, and one scale for all subjects."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.simulator.body.cyberglove import (
    GAINS,
    SENSORS,
    USED,
    ZEROS,
    SubjectCalibration,
    common_joints,
    raw_joints,
    sensors_deg,
)
from thenar.simulator.body.hand import DOF, FAN_DEG, LIMITS_DEG

GAIN_SPREAD, ZERO_SPREAD = 0.12, 8.0
SUBJECTS = [f"subject {number}" for number in range(40)]
# Every digit at one end of its joints' ranges or the other, in all ways: each sensor is at both its ends somewhere.
ENDS = np.where(
    np.repeat((np.arange(32)[:, None] >> np.arange(5)) & 1, 4, axis=1).astype(bool), LIMITS_DEG[:, 0], LIMITS_DEG[:, 1]
)
POSTURES = arrays(np.float64, (3, 20), elements=st.floats(0.0, 1.0)).map(
    lambda part: LIMITS_DEG[:, 0] + part * (LIMITS_DEG[:, 1] - LIMITS_DEG[:, 0])
)
EVERY_BYTE = np.tile(np.arange(1, 256, dtype=np.uint8)[:, None], (1, 18))


def felt(sensor: str, **joints: float) -> float:
    posture = np.zeros((1, 20))
    for joint, degrees in joints.items():
        posture[0, DOF.index(joint)] = degrees
    return float(sensors_deg(posture)[0, SENSORS.index(sensor)])


@pytest.mark.parametrize(
    ("sensor", "joint"),
    [
        ("thumb_rotation", "thumb_cmc_flexion"),
        ("thumb_mpj", "thumb_mcp"),
        ("thumb_ij", "thumb_ip"),
        ("thumb_abduction", "thumb_cmc_abduction"),
        ("index_mpj", "index_mcp"),
        ("index_pij", "index_pip"),
        ("middle_mpj", "middle_mcp"),
        ("middle_pij", "middle_pip"),
        ("ring_mpj", "ring_mcp"),
        ("ring_pij", "ring_pip"),
        ("little_mpj", "little_mcp"),
        ("little_pij", "little_pip"),
    ],
)
def test_a_flexion_sensor_follows_its_joint(sensor: str, joint: str) -> None:
    assert felt(sensor, **{joint: 37.0}) == 37.0


@pytest.mark.parametrize(
    ("sensor", "radial", "ulnar"),
    [
        ("middle_index_abduction", "index", "middle"),
        ("ring_middle_abduction", "middle", "ring"),
        ("little_ring_abduction", "ring", "little"),
    ],
)
def test_an_abduction_sensor_feels_two_fingers_spread_beyond_their_fan(sensor: str, radial: str, ulnar: str) -> None:
    digits = ["thumb", "index", "middle", "ring", "little"]
    fan = float(FAN_DEG[digits.index(radial)] - FAN_DEG[digits.index(ulnar)])
    assert fan > 0.0
    assert felt(sensor) == fan
    assert felt(sensor, **{f"{radial}_abduction": 5.0}) == fan + 5.0
    assert felt(sensor, **{f"{ulnar}_abduction": 5.0}) == fan - 5.0
    assert felt(sensor, **{f"{radial}_abduction": 5.0, f"{ulnar}_abduction": 5.0}) == fan


def test_the_palm_arches_with_ring_and_little_finger() -> None:
    assert felt("palm_arch", little_mcp=90.0) > felt("palm_arch", ring_mcp=90.0) > felt("palm_arch") == 0.0
    everything = sensors_deg(np.full((1, 20), 30.0))
    assert everything[0, USED:].tolist() == [0.0, 0.0]


@given(POSTURES)
def test_a_posture_feels_the_same_in_any_company_and_in_any_shape(postures: np.ndarray) -> None:
    together = sensors_deg(postures)
    assert together.shape == (3, 18)
    for row, posture in enumerate(postures):
        np.testing.assert_array_equal(sensors_deg(posture), together[row])
    np.testing.assert_array_equal(sensors_deg(postures[None])[0], together)


@pytest.mark.parametrize("gain", [1.0 - GAIN_SPREAD, 1.0 + GAIN_SPREAD])
@pytest.mark.parametrize("shift", [-ZERO_SPREAD, ZERO_SPREAD])
def test_possible_postures_stay_within_bytes_for_every_subject(gain: float, shift: float) -> None:
    steps, zeros, angles = GAINS * gain, ZEROS + shift, sensors_deg(ENDS)
    calibration = SubjectCalibration((1.0 - zeros) * steps, (255.0 - zeros) * steps)
    lost = np.abs(calibration.degrees(calibration.bytes(angles)) - angles)
    # Only rounding to the nearest byte is lost: nothing was clipped at 1 or 255.
    assert (lost <= 0.5 * steps + 1e-9).all()


@pytest.mark.parametrize("subject", SUBJECTS[:5])
def test_every_byte_comes_back_as_it_was(subject: str) -> None:
    calibration = SubjectCalibration.of_subject(3, subject)
    np.testing.assert_array_equal(calibration.bytes(calibration.degrees(EVERY_BYTE)), EVERY_BYTE)


def test_what_is_out_of_range_is_clipped_and_no_byte_is_nought() -> None:
    calibration = SubjectCalibration.nominal()
    assert set(calibration.bytes(np.full((1, 18), -1e6)).ravel().tolist()) == {1}
    assert set(calibration.bytes(np.full((1, 18), 1e6)).ravel().tolist()) == {255}


def test_gains_are_those_of_published_calibrations_and_differ_between_subjects() -> None:
    published = {"mpj": (1.2, 1.6), "pij": (0.6, 0.8), "abduction": (0.3, 0.6)}
    own = {"thumb_rotation": (0.95, 1.3), "thumb_mpj": (0.5, 0.75), "thumb_ij": (0.8, 1.15), "palm_arch": (0.0, 1.0)}
    own |= {"wrist_pitch": (0.6, 0.85), "wrist_yaw": (0.23, 0.4)}
    for sensor, gain in zip(SENSORS, GAINS.tolist(), strict=True):
        low, high = own.get(sensor) or published[sensor.rsplit("_", 1)[1]]
        assert low <= gain <= high, sensor
    subjects = [SubjectCalibration.of_subject(3, subject) for subject in SUBJECTS]
    gains = np.array([subject.step_deg / GAINS - 1.0 for subject in subjects])
    shifts = np.array([1.0 - subject.low_deg / subject.step_deg - ZEROS for subject in subjects])
    for found, spread in ((gains, GAIN_SPREAD), (shifts, ZERO_SPREAD)):
        assert np.abs(found).max() <= spread * (1 + 1e-9)
        # Evenly: the sd of 720 numbers is spread / sqrt(3), within 4 standard errors (their kurtosis is 1.8).
        assert abs(found.std() / (spread / 3**0.5) - 1.0) < 4 * (0.8 / 4 / found.size) ** 0.5


def test_a_subject_keeps_a_calibration_and_shares_it_with_nobody() -> None:
    first, again, other, elsewhere = (
        SubjectCalibration.of_subject(*whose).low_deg.tobytes() for whose in [(3, "A"), (3, "A"), (3, "B"), (4, "A")]
    )
    assert first == again
    assert len({first, other, elsewhere}) == 3


@pytest.mark.parametrize("subject", SUBJECTS)
def test_common_codes_mean_the_same_angle_whoever_wears_the_glove(subject: str) -> None:
    calibration, joints = SubjectCalibration.of_subject(3, subject), common_joints()
    codes = calibration.common_codes(EVERY_BYTE)
    assert codes.dtype == np.uint16
    assert codes.shape == (255, USED)
    values = np.stack([joint.value(codes[:, place]) for place, joint in enumerate(joints)], axis=1)
    # Half a step of half a degree, beyond what the byte lost; and no code wrapped round.
    assert np.abs(values - calibration.degrees(EVERY_BYTE)[:, :USED]).max() <= 0.25 + 1e-9
    assert tuple(joint.name for joint in joints) == SENSORS[:USED]
    assert {joint.unit for joint in joints} == {"deg"}


def test_raw_joints_are_read_as_the_typical_subjects() -> None:
    degrees = SubjectCalibration.nominal().degrees(EVERY_BYTE)
    for place, joint in enumerate(raw_joints()):
        np.testing.assert_allclose(joint.value(EVERY_BYTE[:, place]), degrees[:, place], atol=1e-9)
    assert tuple(joint.name for joint in raw_joints()) == SENSORS[:USED]
