"""The CyberGlove as a measuring instrument: a hand's 20 joint angles on its 18 sensors, and their bytes.

Every sensor is a linear function of the angles that bend it. Not modelled: that a real glove's abduction sensors also
respond to flexion, that its two sensors of the thumb's base must be combined, and the wrist.
"""

from collections import Counter
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.compiler.recordings.graspset import Joint
from thenar.drivers.cyberglove_protocol import SENSORS_18

from ..streams import Draw, Site
from .hand import DOF, FAN_DEG

Bytes = NDArray[np.uint8]

# In wire order.
SENSORS = SENSORS_18
# The paper uses all but the wrist.
USED = 16

# The sensors that follow one joint each, in wire order, and that joint.
_FOLLOWS = {
    "thumb_rotation": "thumb_cmc_flexion",
    "thumb_mpj": "thumb_mcp",
    "thumb_ij": "thumb_ip",
    "thumb_abduction": "thumb_cmc_abduction",
    **{f"{finger}_mpj": f"{finger}_mcp" for finger in ("index", "middle", "ring", "little")},
    **{f"{finger}_pij": f"{finger}_pip" for finger in ("index", "middle", "ring", "little")},
}
# The abduction sensors lie between two neighbours, radial one first: positive when these spread.
_BETWEEN = {
    "middle_index_abduction": (1, 2),
    "ring_middle_abduction": (2, 3),
    "little_ring_abduction": (3, 4),
}
# The arch of the palm by MCP flexion of ring and little finger: at 95 degrees about the 10 and 15 degrees of their
# metacarpals. Ours.
_ARCH_RING, _ARCH_LITTLE = 0.10, 0.15

# Degrees per count: the mean of two published calibration files of real gloves. The palm arch is ours.
_GAINS = {"thumb_rotation": 1.1, "thumb_mpj": 0.65, "thumb_ij": 1.0, "palm_arch": 0.3, "wrist_pitch": 0.7}
_GAINS |= {"wrist_yaw": 0.3}
_KIND_GAINS = {"mpj": 1.4, "pij": 0.7, "abduction": 0.5}
# The byte at 0 degrees, close to that of open hands, so that the whole range of every joint fits between 1 and 255.
_ZEROS = {"thumb_rotation": 110.0, "thumb_mpj": 80.0, "thumb_ij": 80.0, "thumb_abduction": 70.0, "palm_arch": 90.0}
_ZEROS |= {"wrist_pitch": 128.0, "wrist_yaw": 128.0}
_KIND_ZEROS = {"mpj": 117.0, "pij": 50.0, "abduction": 110.0}
# Subjects differ by at most this much, evenly: a share of the gain, counts at 0 degrees. Ours.
_GAIN_SPREAD, _ZERO_SPREAD = 0.12, 8.0

_LEAST, _MOST = 1, 255  # 0 ends a frame

# The common scale of all subjects: half degrees, the paper's resolution, starting below any byte.
_COMMON_ORIGIN_DEG, _COMMON_STEP_DEG = -250.0, 0.5


def sensors_deg(posture_deg: Floats) -> Floats:
    """Return the sensor angles (..., 18) for joint angles (..., 20), both in degrees."""
    felt = {sensor: posture_deg[..., DOF.index(joint)] for sensor, joint in _FOLLOWS.items()}
    for sensor, (radial, ulnar) in _BETWEEN.items():
        fan = FAN_DEG[radial] - FAN_DEG[ulnar]
        felt[sensor] = posture_deg[..., 4 * radial] - posture_deg[..., 4 * ulnar] + fan
    felt["palm_arch"] = _ARCH_RING * felt["ring_mpj"] + _ARCH_LITTLE * felt["little_mpj"]
    felt["wrist_pitch"] = felt["wrist_yaw"] = np.zeros(posture_deg.shape[:-1])
    return np.stack([felt[sensor] for sensor in SENSORS], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class SubjectCalibration:
    """Two points of each sensor's straight line: degrees (18,) at byte 1 and at byte 255."""

    low_deg: Floats
    high_deg: Floats

    @classmethod
    def of_subject(cls, seed: int, subject: str) -> Self:
        """Return the calibration for a subject of the scene with this seed. Not an effect: no ledger counts it."""
        site = Site(subject, "", "", np.zeros(0, dtype=np.int64))
        spread = 2.0 * Draw(seed, "glove.calibration", site, Counter()).per_subject(2, 18).uniform() - 1.0
        return cls._of(GAINS * (1.0 + _GAIN_SPREAD * spread[0]), ZEROS + _ZERO_SPREAD * spread[1])

    @classmethod
    def nominal(cls) -> Self:
        """Return the calibration for the typical subject."""
        return cls._of(GAINS, ZEROS)

    @classmethod
    def _of(cls, gains: Floats, zeros: Floats) -> Self:
        return cls((_LEAST - zeros) * gains, (_MOST - zeros) * gains)

    @property
    def step_deg(self) -> Floats:
        """Degrees per count of each sensor (18,)."""
        return (self.high_deg - self.low_deg) / (_MOST - _LEAST)

    def bytes(self, degrees: Floats) -> Bytes:
        """Return the bytes (..., 18) of angles in degrees: the nearest, 1 to 255."""
        counts = np.rint(_LEAST + (degrees - self.low_deg) / self.step_deg)
        return np.clip(counts, _LEAST, _MOST).astype(np.uint8)

    def degrees(self, raw: Bytes) -> Floats:
        """Return the angles in degrees of bytes (..., 18)."""
        return self.low_deg + (raw.astype(np.float64) - _LEAST) * self.step_deg

    def common_codes(self, raw: Bytes) -> NDArray[np.uint16]:
        """Return the codes (..., 16) of bytes (..., 18) on the scale of all subjects (`common_joints`)."""
        steps = (self.degrees(raw)[..., :USED] - _COMMON_ORIGIN_DEG) / _COMMON_STEP_DEG
        return np.rint(steps).astype(np.uint16)


def common_joints() -> tuple[Joint, ...]:
    """Return the joints of `Calibration.common_codes`: 16 joints, half a degree a code."""
    end = _COMMON_ORIGIN_DEG + 1000 * _COMMON_STEP_DEG
    return tuple(Joint(sensor, "deg", 0, _COMMON_ORIGIN_DEG, 1000, end) for sensor in SENSORS[:USED])


def raw_joints() -> tuple[Joint, ...]:
    """Return the joints of the raw bytes on the typical subject: 16 joints."""
    nominal = SubjectCalibration.nominal()
    ends = zip(SENSORS[:USED], nominal.low_deg.tolist(), nominal.high_deg.tolist(), strict=False)
    return tuple(Joint(sensor, "deg", _LEAST, low, _MOST, high) for sensor, low, high in ends)


def _by_sensor(own: dict[str, float], kinds: dict[str, float]) -> Floats:
    return np.array([own[name] if name in own else kinds[name.rsplit("_", 1)[1]] for name in SENSORS])


GAINS = _by_sensor(_GAINS, _KIND_GAINS)
ZEROS = _by_sensor(_ZEROS, _KIND_ZEROS)
