"""A build whose joints are coded in any way, as the same build for the bytes that one hand's CyberGlove sends."""

from msgspec.structs import replace

from thenar.drivers.calibration import GloveCalibration
from thenar.runtime.build import Build
from thenar.runtime.calibration import codes_of_bytes
from thenar.runtime.manifest import Calibration

from .on_bytes import on_bytes

_FIRST, _LAST = 1, 255  # what a CyberGlove can send


def for_one_hand(build: Build, calibration: GloveCalibration) -> Build:
    """Return `build` for the raw bytes of the glove that `calibration` is of: each byte is answered as its code was.

    Raises SettingError where the calibration lacks a joint of the build, or is in another unit.
    """
    joints = build.manifest.joints
    tables = on_bytes(build.tables, [codes_of_bytes(joint, calibration) for joint in joints])
    raw = tuple(Calibration(joint.column, joint.name, "raw", _FIRST, 1.0, _LAST, 255.0) for joint in joints)
    return Build(replace(build.manifest, joints=raw), tables)
