"""Playback of a scene, a set of grasps or a recording by an emulated glove."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Event
from time import monotonic_ns

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.recordings.graspset import CODES, GraspSet, Joint
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.published import NONE, UNKNOWN, LiveGrasp
from thenar.runtime.recording.layout import switch_matrix
from thenar.runtime.recording.reader import Reader, check_made
from thenar.runtime.recording.session import Label
from thenar.runtime.taxels import TaxelCalibration, TaxelLine

from ..body.cyberglove import SENSORS, USED, SubjectCalibration
from ..errors import SceneError
from ..pipeline.simulation import simulate
from ..planning.plan import Progress
from ..scenes.scene import Scene

Bits = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Codes = NDArray[np.uint16]

_WIRE, _TRANSITION = "wire.", "hand.transition"
# Called for every shown frame with its number, its grasp type, and the monotonic clock in microseconds.
Log = Callable[[int, str, int], None]


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """F frames of one subject.

    switches     (F, s) bool       switch_names  s names
    sensors      (F, 18) uint8     the CyberGlove's bytes, in wire order
    grasps       (F,) str          the held grasp types, "none" if nothing is held
    period_us                      from one frame to the next
    calibration  of the bytes on this subject's hand
    taxels       (F, t) uint16     taxel_names  t names
    taxel_calibration  of the taxels' counts; None: plain counts
    joints       (F, j) float64    joint_names  j names: the same joints, or more of them, for streams of numbers; in
                 the units of `joint_units`, of which "raw" are bytes
    """

    switches: Bits
    switch_names: tuple[str, ...]
    sensors: Bytes
    grasps: NDArray[np.str_]
    period_us: int
    calibration: GloveCalibration
    taxels: Codes = field(default_factory=lambda: np.empty((0, 0), np.uint16))
    taxel_names: tuple[str, ...] = ()
    taxel_calibration: TaxelCalibration | None = None
    joints: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    joint_names: tuple[str, ...] = ()
    joint_units: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.joint_names:
            object.__setattr__(self, "joints", np.empty((len(self), 0)))
        if not self.taxel_names:
            object.__setattr__(self, "taxels", np.empty((len(self), 0), np.uint16))

    def __len__(self) -> int:
        return len(self.switches)

    def with_rests(self, ends: NDArray[np.intp], rest_us: int) -> "Performance":
        """Return it with a straight, empty hand for `rest_us`, in whole frames, after each of the frames `ends`."""
        at = np.repeat(ends + 1, max(-(-rest_us // self.period_us), 1))
        pads = self.taxel_calibration
        lines = {} if pads is None else {one.name: one.raw_a for one in pads.sensors}
        return replace(
            self,
            switches=np.insert(self.switches, at, False, axis=0),
            sensors=np.insert(self.sensors, at, resting(self.calibration), axis=0),
            grasps=np.insert(self.grasps.astype(np.object_), at, NONE).astype(np.str_),
            taxels=np.insert(self.taxels, at, [lines.get(name, 0) for name in self.taxel_names], axis=0),
            joints=np.insert(self.joints, at, self._open(), axis=0),
        )

    def _open(self) -> list[float]:
        """Return the joints of an open hand: straight for angles, otherwise their lowest values."""
        least = self.joints.min(axis=0, initial=np.inf).tolist()
        return [0.0 if unit == "deg" else end for unit, end in zip(self.joint_units, least, strict=True)]

    def play(self, show: Callable[[list[bool], bytes, list[int], list[float]], None], log: Log, stop: Event) -> bool:
        """Show all frames once, each `period_us` after the previous one; delays do not accumulate.

        Returns False if `stop` was set before the end of the last one.
        """
        start_us = monotonic_ns() // 1000
        for row in range(len(self)):
            now_us = monotonic_ns() // 1000
            if stop.wait(max(start_us + row * self.period_us - now_us, 0) / 1e6):
                return False
            joints = self.joints[row].tolist()
            show(self.switches[row].tolist(), self.sensors[row].tobytes(), self.taxels[row].tolist(), joints)
            log(row, str(self.grasps[row]), monotonic_ns() // 1000)
        return not stop.wait(self.period_us / 1e6)


def of_scene(
    scene: Scene,
    subject: str | None = None,
    jobs: int = -1,
    progress: Progress | None = None,
    *,
    period_us: int | None = None,
    rest_us: int | None = None,
) -> Performance:
    """Return one subject's session of `scene`, by default the first subject's, without the wire effects.

    A scene that keeps every frame is played frame by frame; one that keeps one row per grasp shows each row as long as
    the grasp is held; period_us plays it faster or slower. With rest_us the hand rests between grasps for this time: it
    moves there if the scene has transitions, otherwise it is there at once. Raises SceneError.
    """
    names = [each.name for each in scene.subjects]
    if subject is not None and subject not in names:
        raise SceneError(f"scene {scene.name} has no subject {subject!r}: its subjects are {', '.join(names)}")
    one = next(each for each in scene.subjects if each.name == (subject or names[0]))
    recording = scene.recording
    own_us = round(1e6 / recording.rate_hz if recording.rows == "all" else recording.hold_ms * 1000)
    period_us = period_us or own_us
    moves = recording.rows == "all" and any(listed.name == _TRANSITION for listed in scene.effects)
    if moves and rest_us is not None:
        rest = recording.rest or True
        recording = msgspec.structs.replace(recording, rest=rest, rest_ms=rest_us / 1000 * own_us / period_us)
    played = msgspec.structs.replace(
        scene,
        recording=recording,
        subjects=(one,),
        glove=msgspec.structs.replace(scene.glove, codes="raw"),
        effects=tuple(listed for listed in scene.effects if not listed.name.startswith(_WIRE)),
    )
    grasp_set = simulate(played, jobs, progress).grasp_set
    calibration = SubjectCalibration.of_subject(scene.seed, one.name)
    found = Performance(
        switches=grasp_set.switches,
        switch_names=grasp_set.switch_names,
        sensors=_with_wrist(grasp_set.codes.astype(np.uint8), calibration),
        grasps=grasp_set.grasps,
        period_us=period_us,
        calibration=_in_points(calibration, one.name),
        taxels=grasp_set.taxels,
        taxel_names=tuple(taxel.name for taxel in grasp_set.taxel_columns),
        taxel_calibration=_taxel_calibration(grasp_set.taxel_columns),
    )
    found = replace(found, joints=_angles(found), joint_names=SENSORS, joint_units=("deg",) * len(SENSORS))
    return found if moves or rest_us is None else found.with_rests(_ends(grasp_set), rest_us)


def _angles(performance: Performance) -> NDArray[np.float64]:
    """Return the angles of its CyberGlove's bytes."""
    lines = [
        [line.value(raw) for raw in range(256)]
        for name in SENSORS
        for line in performance.calibration.sensors
        if line.name == name
    ]
    return np.array(lines)[np.arange(len(lines)), performance.sensors]


def _ends(grasp_set: GraspSet) -> NDArray[np.intp]:
    """Return the last row of each movement."""
    movements = grasp_set.movement_ids
    return np.flatnonzero(np.append(movements[1:] != movements[:-1], True))


def of_set(
    grasp_set: GraspSet,
    period_us: int,
    calibration: GloveCalibration | None = None,
    rest_us: int | None = None,
    *,
    cyberglove: bool = True,
) -> Performance:
    """Return the rows of `grasp_set`, in order, as sent by a glove with this calibration; with rest_us, a straight hand
    after each movement for this time.

    A code between two bytes of a sensor is played as the nearest byte. Sensors missing from the set rest. The default
    calibration is that of a typical hand. Raises SceneError if a `cyberglove` must play it, but none of its joints is a
    sensor.
    """
    meant = calibration or typical()
    known = {sensor.name: sensor for sensor in meant.sensors}
    shared = [joint for joint in grasp_set.joints if joint.name in known]
    if cyberglove and grasp_set.joints and not shared:
        raise SceneError(f"none of the set's joints is a sensor of the CyberGlove: it has {', '.join(sorted(known))}")
    sensors = np.tile(resting(meant), (len(grasp_set), 1))
    raw = np.arange(1, 256)
    for joint in shared:
        values = np.array([known[joint.name].value(int(byte)) for byte in raw])
        given = joint.code(values)
        codes = grasp_set.codes[:, grasp_set.joint_names.index(joint.name)].astype(np.float64)
        order = np.argsort(given, kind="stable")
        sensors[:, SENSORS.index(joint.name)] = raw[order][_nearest(given[order], codes)]
    found = Performance(
        grasp_set.switches,
        grasp_set.switch_names,
        sensors,
        grasp_set.grasps,
        period_us,
        calibration=meant,
        taxels=grasp_set.taxels,
        taxel_names=tuple(taxel.name for taxel in grasp_set.taxel_columns),
        taxel_calibration=_taxel_calibration(grasp_set.taxel_columns),
        joints=_values(grasp_set),
        joint_names=grasp_set.joint_names,
        joint_units=tuple(joint.unit for joint in grasp_set.joints),
    )
    return found if rest_us is None else found.with_rests(_ends(grasp_set), rest_us)


def _values(grasp_set: GraspSet) -> NDArray[np.float64]:
    """Return the joints in their units."""
    columns = [joint.value(grasp_set.codes[:, place]) for place, joint in enumerate(grasp_set.joints)]
    return np.array(columns, np.float64).reshape(len(columns), len(grasp_set)).T


def _taxel_calibration(columns: tuple[Joint, ...]) -> TaxelCalibration | None:
    """Return the calibration of codes played as counts; None if they are plain counts.

    Raises SceneError if no calibration of a glove can express it.
    """
    meant = [taxel for taxel in columns if (taxel.code_a, taxel.code_b) != (taxel.value_a, taxel.value_b)]
    if not meant:
        return None
    lines = []
    for taxel in meant:
        rest = round(float(taxel.code(0.0)))
        press = max((taxel.code_a, taxel.code_b), key=lambda code: abs(code - rest))
        value = float(taxel.value(press))
        if (
            taxel.unit != meant[0].unit
            or not (0 <= rest < CODES and value > 0)
            or abs(taxel.value(rest)) > 1e-6 * value
        ):
            raise SceneError(
                f"taxel {taxel.name!r}: its codes cannot be a converter's counts of {meant[0].unit}: none of them is 0"
            )
        lines.append(TaxelLine(taxel.name, rest, 0.0, press, value))
    return TaxelCalibration(unit=meant[0].unit, sensors=tuple(lines))


def _nearest(rising: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return, for each wanted value, the index of the nearest of `rising`; of two, the lower."""
    above = np.clip(np.searchsorted(rising, wanted), 1, len(rising) - 1)
    return np.where(wanted - rising[above - 1] <= rising[above] - wanted, above - 1, above)


def _with_wrist(used: Bytes, calibration: SubjectCalibration) -> Bytes:
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
    """Return the calibration of a typical hand."""
    return _in_points(SubjectCalibration.nominal(), "")


def _in_points(calibration: SubjectCalibration, subject: str) -> GloveCalibration:
    ends = zip(SENSORS, calibration.low_deg.tolist(), calibration.high_deg.tolist(), strict=True)
    return GloveCalibration(
        sensors=tuple(SensorCalibration(name, 1, low, 255, high) for name, low, high in ends),
        unit="deg",
        subject=subject,
    )


# The switches, the sensors, the taxels, and the grasp type of one moment.
Moment = tuple[int, bytes, tuple[int, ...], str]


def of_recording(path: Path, period_us: int, warn: Callable[[str], None] = lambda _: None) -> Performance:
    """Return the newest frames of a recording every `period_us`, with the grasp type predicted, or collected, by then.

    Without a CyberGlove its sensors rest. `warn` gets a sentence on each fault of the file. Raises FormatError if it is
    not a recording, SceneError if it holds no frames.
    """
    reader = Reader(path)
    calibration = reader.session.calibration or typical()
    rest = b"" if reader.session.sensors else resting(calibration).tobytes()
    rows = list(_ticks(reader, rest, period_us))
    for fault in reader.faults():
        warn(fault.message)
    if not rows:
        raise SceneError(f"{path.name}: holds no glove frames")
    names = reader.session.switches
    assert reader.end is not None
    width = len(names) + len(rows[0][1]) + 2 * len(rows[0][2]) + 4 * max(len(grasp) for *_, grasp in rows)
    check_made(f"{path.name}: what it plays", len(rows) * width, reader.end.size)
    sensors = np.frombuffer(b"".join(sensors for _, sensors, *_ in rows), np.uint8).reshape(len(rows), -1)
    return Performance(
        switches=switch_matrix([closed for closed, *_ in rows], len(names)),
        switch_names=names,
        sensors=sensors,
        grasps=np.array([grasp for *_, grasp in rows]),
        period_us=period_us,
        calibration=calibration,
        taxels=np.array([codes for _, _, codes, _ in rows], np.uint16),
        taxel_names=reader.session.taxels,
        taxel_calibration=reader.session.taxel_calibration,
        joints=sensors.astype(np.float64),
        joint_names=reader.session.sensors or SENSORS,
        joint_units=("raw",) * sensors.shape[1],
    )


def _ticks(reader: Reader, rest: bytes, period_us: int) -> Iterator[Moment]:
    """Yield a moment every `period_us`, starting when all devices named by the recording have been read."""
    closed: int | None = 0 if not reader.session.switches else None
    sensors: bytes | None = rest if not reader.session.sensors else None
    codes = None if reader.session.taxels else tuple[int, ...]()
    grasp, due_us = UNKNOWN, None
    for entry in reader:
        if isinstance(entry, SwitchFrame):
            closed = entry.closed
            if entry.taxels is not None:
                before = codes or (0,) * len(entry.taxels)
                codes = tuple(old if code is None else code for old, code in zip(before, entry.taxels, strict=True))
        elif isinstance(entry, GloveFrame):
            sensors = entry.sensors
        elif isinstance(entry, LiveGrasp) or (isinstance(entry, Label) and entry.event != "begun"):
            grasp = entry.grasp
        else:
            continue
        if closed is None or sensors is None or codes is None:
            continue
        if due_us is None:
            due_us = entry.time_us
        if entry.time_us >= due_us:
            yield closed, sensors, codes, grasp
            due_us += period_us
