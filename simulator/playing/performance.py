"""What an emulated glove plays: the frames of a scene or of a set of grasps, as the devices would send them."""

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.recordings.graspset import GraspSet
from thenar.drivers.calibration import GloveCalibration, SensorCalibration

from ..body.cyberglove import SENSORS, USED, Calibration
from ..errors import SceneError
from ..running.simulation import Progress, simulate
from ..scenes.scene import Scene

Bits = NDArray[np.bool_]
Bytes = NDArray[np.uint8]

_WIRE = "wire."


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """F frames of one subject.

    switches     (F, s) bool       switch_names  s names
    sensors      (F, 18) uint8     the CyberGlove's bytes, in wire order
    grasps       (F,) str          the grasp types that are being made
    period_us                      from one frame to the next
    calibration  what the bytes mean on this subject's hand
    """

    switches: Bits
    switch_names: tuple[str, ...]
    sensors: Bytes
    grasps: NDArray[np.str_]
    period_us: int
    calibration: GloveCalibration

    def __len__(self) -> int:
        return len(self.switches)


def of_scene(scene: Scene, subject: str | None = None, jobs: int = -1, progress: Progress | None = None) -> Performance:
    """Return one subject's session of `scene`, the first one's by default, without what happens on its wires.

    A scene that keeps every frame is played frame by frame; one that keeps a row of each grasp shows each row as long
    as the grasp is held. Raises SceneError.
    """
    names = [each.name for each in scene.subjects]
    if subject is not None and subject not in names:
        raise SceneError(f"scene {scene.name} has no subject {subject!r}: its subjects are {', '.join(names)}")
    one = next(each for each in scene.subjects if each.name == (subject or names[0]))
    played = msgspec.structs.replace(
        scene,
        subjects=(one,),
        glove=msgspec.structs.replace(scene.glove, codes="raw"),
        effects=tuple(listed for listed in scene.effects if not listed.name.startswith(_WIRE)),
    )
    grasp_set = simulate(played, jobs, progress).grasp_set
    calibration = Calibration.of_subject(scene.seed, one.name)
    recording = scene.recording
    period_us = round(1e6 / recording.rate_hz if recording.rows == "all" else recording.hold_ms * 1000)
    return Performance(
        switches=grasp_set.switches,
        switch_names=grasp_set.switch_names,
        sensors=_with_wrist(grasp_set.codes.astype(np.uint8), calibration),
        grasps=grasp_set.grasps,
        period_us=period_us,
        calibration=_in_points(calibration, one.name),
    )


def of_set(grasp_set: GraspSet, period_us: int, calibration: GloveCalibration | None = None) -> Performance:
    """Return the rows of `grasp_set`, one after the other, as a glove of this calibration would send them.

    A code that no byte of a sensor gives is played as the byte that comes nearest. Sensors that the set does not have
    rest. Without a calibration: of a typical hand. Raises SceneError where none of its joints is a sensor's.
    """
    meant = calibration or typical()
    known = {sensor.name: sensor for sensor in meant.sensors}
    shared = [joint for joint in grasp_set.joints if joint.name in known]
    if grasp_set.joints and not shared:
        raise SceneError(f"none of the set's joints is a sensor of the CyberGlove: it has {', '.join(sorted(known))}")
    sensors = np.tile(resting(meant), (len(grasp_set), 1))
    raw = np.arange(1, 256)
    for joint in shared:
        values = np.array([known[joint.name].value(int(byte)) for byte in raw])
        given = joint.code(values)
        codes = grasp_set.codes[:, grasp_set.joint_names.index(joint.name)].astype(np.float64)
        order = np.argsort(given, kind="stable")
        sensors[:, SENSORS.index(joint.name)] = raw[order][_nearest(given[order], codes)]
    return Performance(
        grasp_set.switches, grasp_set.switch_names, sensors, grasp_set.grasps, period_us, calibration=meant
    )


def _nearest(rising: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return, for each wanted value, the place of the nearest of `rising`; of two, the lower."""
    above = np.clip(np.searchsorted(rising, wanted), 1, len(rising) - 1)
    return np.where(wanted - rising[above - 1] <= rising[above] - wanted, above - 1, above)


def _with_wrist(used: Bytes, calibration: Calibration) -> Bytes:
    """Return all 18 bytes (F, 18): the wrist, which is not simulated, is straight."""
    straight = calibration.bytes(np.zeros(len(SENSORS)))[USED:]
    return np.hstack([used, np.tile(straight, (len(used), 1))])


def resting(calibration: GloveCalibration) -> Bytes:
    """Return the bytes (18,) of a straight hand."""
    at_zero = {sensor.name: _byte_at_zero(sensor) for sensor in calibration.sensors}
    return np.array([at_zero.get(name, 128) for name in SENSORS], dtype=np.uint8)


def _byte_at_zero(sensor: SensorCalibration) -> int:
    return min(range(1, 256), key=lambda raw: abs(sensor.value(raw)))


def typical() -> GloveCalibration:
    """Return what the bytes mean on a typical hand."""
    return _in_points(Calibration.nominal(), "")


def _in_points(calibration: Calibration, subject: str) -> GloveCalibration:
    ends = zip(SENSORS, calibration.low_deg.tolist(), calibration.high_deg.tolist(), strict=True)
    return GloveCalibration(
        sensors=tuple(SensorCalibration(name, 1, low, 255, high) for name, low, high in ends),
        unit="deg",
        subject=subject,
    )
