"""Import recordings of guided collections (MCAP) as a `GraspSet`: a row per accepted trial, or a stream.

A row is the last reading of each device when the grasp was captured. Trials in which nothing is held have a row for
every 0.2 s of their movement. A stream has a row for every 10 ms, with its time: a grasp is held while the hand stays
as it was captured, and nothing is held in the rest of the trials of a collection that also records the empty hand. In
other collections the rest is left out. Trials that were repeated, skipped or undone are always left out.

The CyberGlove's sensors except the wrist's, which the paper does not use either, become joints: raw bytes if the glove
was not calibrated, otherwise half degrees on one scale for all subjects. Taxels keep their counts, corrected for the
drift of their baselines; if they were calibrated, all counts are converted to the first calibration.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from thenar.runtime.calibration import RAW, Meaning, codes_of_bytes, numbers_of
from thenar.runtime.code_line import code_line
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import StreamWiring
from thenar.runtime.manifest import Calibration as BuildCalibration
from thenar.runtime.names import SHOWN, shortened
from thenar.runtime.published import NONE
from thenar.runtime.recording.guide import FRESH_US
from thenar.runtime.recording.layout import switch_matrix
from thenar.runtime.recording.reader import Oddity, Reader, check_made
from thenar.runtime.recording.session import Collection, Label, Session
from thenar.runtime.taxels import TaxelLine

from . import TableError, list_rows
from .bags import is_recording
from .columns import CalibrationPoints, JointColumns
from .graspset import CODES, GraspSet, Joint
from .importer import CodingCost, ImportReport, code_joint, import_file, report_of
from .summary import find_oddities
from .taxonomy import Taxonomy
from .trial_files import Report

WRIST = ("wrist_pitch", "wrist_yaw")
# Half degrees, the paper's resolution, from below the range of a calibrated hand.
_HALF_DEGREES = CalibrationPoints(code_a=0, value_a=-250.0, code_b=1000, value_b=250.0)
_BYTES = CalibrationPoints(code_a=1, value_a=1.0, code_b=255, value_b=255.0)


@dataclass(frozen=True, slots=True)
class _Grasp:
    """A row: the trial and its grasp, and the newest frames at `time_us`; a taxel's count is None if it had a fault."""

    label: Label
    switches: SwitchFrame | None
    glove: GloveFrame | None
    counts: tuple[int | None, ...] = ()
    time_us: int = 0

    def whole(self, session: Session) -> bool:
        """Return whether everything that the session records was read."""
        read = self.switches is not None and not self.switches.lost
        read = read and len(self.counts) == len(session.taxels) and None not in self.counts
        # A byte of 0 means that a sensor was not measured.
        measured = not session.sensors or (self.glove is not None and 0 not in self.glove.sensors)
        return measured and (read or not (session.switches or session.taxels))


@dataclass(slots=True)
class _Attempt:
    """A captured trial: its start, the time of its judgement, its rows, the last at its capture, and the judgement."""

    begun_us: int
    judged_us: int
    rows: tuple[_Grasp, ...]
    accepted: bool = False


@dataclass(frozen=True, slots=True)
class _Part:
    """The content of one session."""

    what: str
    session: Session
    collection: Collection
    grasps: tuple[_Grasp, ...]


def import_files(
    paths: Sequence[Path],
    columns: Path | None = None,
    stream: bool = False,
    progress: Report = lambda _done, _total: None,
) -> tuple[GraspSet, ImportReport]:
    """Import tables of the same trials with the columns.toml in file `columns`, or self-describing recordings.

    The first table says which rows there are. A path with fields in braces, such as data/{label}_{trial}.csv, is a
    table in many files; `progress` takes how many of how many were read. Recordings are imported as a `stream` or trial
    by trial. Raises TableError, RecordingError or FormatError naming file, rows and columns, and OSError.
    """
    if all(map(is_recording, paths)):
        if columns is not None:
            raise TableError(f"a recording describes its own columns: leave {columns.name} out")
        return import_recordings(paths, stream)
    if stream:
        raise TableError("each row of a table is imported as it is: ``stream`` is for recordings (.mcap), leave it out")
    if columns is None:
        raise TableError(f"{paths[0].name}: name the columns.toml that says what its columns are")
    return import_file(paths[0], columns, progress, paths[1:])


def import_recordings(
    paths: Sequence[Path], stream: bool = False, codings: Mapping[str, BuildCalibration] | None = None
) -> tuple[GraspSet, ImportReport]:
    """Import the accepted trials of recordings of one glove and one taxonomy; subjects may differ.

    As a `stream` they have a row every 10 ms, and every restart is a separate session. With the `codings` of a build,
    by the names of its joints and taxels, these have the codes that the build gets live. Raises FormatError,
    TableError or RecordingError naming the file, SettingError if a reading has no such code, and OSError.
    """
    parts: list[_Part] = []
    findings: list[Oddity] = []
    size = 0
    for path in paths:
        reader = Reader(path)
        parts += _parts(reader, stream)
        findings += reader.faults()
        size += reader.end.size if reader.end is not None else 0
    what = ", ".join(path.name for path in paths)
    _check_alike(parts)
    grasps = [(part, grasp) for part in parts for grasp in part.grasps if grasp.whole(part.session)]
    if left_out := [grasp.label.trial for part in parts for grasp in part.grasps if not grasp.whole(part.session)]:
        message = (
            f"{len(left_out)} {'rows' if stream else 'trials'} in which not everything was read were left out: "
            f"{list_rows(np.array(left_out))}"
        )
        findings.append(Oddity("dropped rows", len(left_out), message, tuple(left_out[:SHOWN])))
    if not grasps:
        raise TableError(f"{what}: no trial was accepted; `thenar record` makes recordings with labelled trials")
    # A row of a stream takes as much memory as any other.
    check_made(f"{what}: its trials", _bytes_of(grasps) // (4 if stream else 1), size)
    grasp_set, costs = _joined(grasps, stream, codings or {})
    return grasp_set, report_of(what, grasp_set, costs, (*findings, *find_oddities(grasp_set, grasp_set.trials)))


# Time between rows of a trial in which nothing is held, and of a stream.
_MOVING_TICK_US, _TICK_US = 200_000, 10_000
# A hold in a stream survives this many ticks in which the hand seems to move; and joints this close to their captured
# values, as a share of their range, have not moved.
_BRIDGED, _NEAR, _NEAR_CODES = 3, 0.25, 2.0


def _parts(reader: Reader, stream: bool) -> list[_Part]:
    """Return every session with trials; sessions without are not labelled and contribute nothing."""
    parts: list[_Part] = []
    for watch in _watched(reader, stream):
        if watch.undone:
            kept = (tuple(row for row in part.grasps if row.label.trial not in watch.undone) for part in parts)
            parts = [replace(part, grasps=grasps) for part, grasps in zip(parts, kept, strict=True)]
        collection = watch.session.collection
        if collection is not None and (rows := _streamed(watch, collection) if stream else watch.rows()):
            parts.append(_Part(reader.path.name, watch.session, collection, rows))
    return [part for part in parts if part.grasps]


def _watched(reader: Reader, stream: bool) -> Iterator["_Watch"]:
    """Yield the state of each session at its end."""
    watch = _Watch(reader, stream)
    for entry in reader:
        if isinstance(entry, Session):
            yield watch
            watch = _Watch(reader, stream)
        elif isinstance(entry, SwitchFrame | GloveFrame):
            watch.frame(entry)
        elif isinstance(entry, Label):
            watch.label(entry)
    yield watch


class _Watch:
    """The current session: its newest frames, captured trials, and rows at ticks.

    A stream has rows from the first label on, other imports only while the empty hand moves; `undone` are trials of
    earlier sessions that do not count.
    """

    def __init__(self, reader: Reader, stream: bool) -> None:
        self.session, self.attempts, self.ticks = reader.session, list[_Attempt](), list[_Grasp]()
        self.undone: set[int] = set()
        self._path, self._size = reader.path, reader.path.stat().st_size
        self._stream, self._tick_us = stream, _TICK_US if stream else _MOVING_TICK_US
        self._counts: tuple[int | None, ...] = ()
        self._switches: SwitchFrame | None = None
        self._glove: GloveFrame | None = None
        self._label: Label | None = None
        self._begun_us: int | None = None
        self._due_us: int | None = None

    def rows(self) -> tuple[_Grasp, ...]:
        """Return the rows of accepted trials."""
        return tuple(row for attempt in self.attempts if attempt.accepted for row in attempt.rows)

    def frame(self, frame: SwitchFrame | GloveFrame) -> None:
        """Process a frame, after the ticks that are due before it."""
        self._tick(frame.time_us)
        if isinstance(frame, SwitchFrame):
            self._switches = frame
            self._counts = frame.taxels or (None,) * len(self.session.taxels)
        else:
            self._glove = frame

    def label(self, label: Label) -> None:
        """Process the outcome of a trial."""
        self._tick(label.time_us)
        before, self._label = self._label, label
        if label.event == "begun":
            self._begun_us = label.time_us
            if not self._stream and label.grasp == NONE:
                self.ticks, self._due_us = [], label.time_us + self._tick_us
        elif label.event == "captured":
            row = self._row(label, label.time_us)
            ticks = self.ticks if self._due_us is not None and not self._stream else []
            # The last tick may be slightly before the capture.
            enough_us = label.time_us - self._tick_us // 2
            rows = [replace(tick, label=label) for tick in ticks if tick.time_us <= enough_us]
            begun_us = self._begun_us
            if begun_us is None:
                begun_us = self.attempts[-1].judged_us if self.attempts else label.time_us
            self.attempts.append(_Attempt(begun_us, label.time_us, (*rows, row)))
            self._begun_us = None
        elif before is not None and before.event == "captured":
            accepted = label.event == "accepted" and label.trial == before.trial
            self.attempts[-1].accepted, self.attempts[-1].judged_us = accepted, label.time_us
        elif label.event == "undone":
            same = [each for each in self.attempts if each.accepted and each.rows[-1].label.trial == label.trial]
            if same:
                same[-1].accepted = False
            else:
                self.undone.add(label.trial)
        if self._stream:
            self._due_us = label.time_us if self._due_us is None else self._due_us
        elif label.event != "begun":
            self._due_us = None

    def _tick(self, until_us: int) -> None:
        """Add the rows that are due before `until_us`, while devices are read."""
        while self._label is not None and self._due_us is not None and self._due_us < until_us:
            steps = 1
            if self._is_fresh(self._due_us):
                self.ticks.append(self._row(self._label, self._due_us))
                if len(self.ticks) % 1000 == 0:
                    made = len(self.ticks) * (128 + 8 * len(self.session.taxels))
                    check_made(f"{self._path.name}: its stream", made // 4, self._size)
            else:
                steps = -(-(until_us - self._due_us) // self._tick_us)
            self._due_us += steps * self._tick_us

    def _is_fresh(self, time_us: int) -> bool:
        switches, glove, session = self._switches, self._glove, self.session
        lacks = bool(session.switches or session.taxels) and (switches is None or time_us - switches.time_us > FRESH_US)
        return not lacks and not (session.sensors and (glove is None or time_us - glove.time_us > FRESH_US))

    def _row(self, label: Label, time_us: int) -> _Grasp:
        return _Grasp(label, self._switches, self._glove, self._counts, time_us)


def _streamed(watch: _Watch, collection: Collection) -> tuple[_Grasp, ...]:
    """Return the rows of a session as a stream: those with a grasp, and the other rows of trials with an empty hand."""
    ticks, attempts, session = watch.ticks, watch.attempts, watch.session
    if not ticks:
        return ()
    time = np.array([tick.time_us for tick in ticks], np.int64)
    closed = switch_matrix([tick.switches.closed if tick.switches else 0 for tick in ticks], len(session.switches))
    places = [place for place, name in enumerate(session.sensors) if name not in WRIST]
    codes = np.array([[tick.glove.sensors[place] for place in places] if tick.glove else [] for tick in ticks])
    if not places:
        codes = np.array([[count or 0 for count in tick.counts] for tick in ticks])
    codes = codes.astype(np.int32).reshape(len(ticks), -1)
    empty = {number for number, attempt in enumerate(attempts) if attempt.rows[-1].label.grasp == NONE}
    empty = empty if NONE not in collection.types else set()
    trial, held = np.full(len(ticks), -1), np.zeros(len(ticks), np.bool_)
    ends = [int(np.searchsorted(time, each.rows[-1].time_us, "right")) for each in attempts]
    # A damaged recording may have captures in the wrong order.
    captures = np.maximum.accumulate([0, *ends, len(ticks)]).tolist()
    records_none = NONE in {task.grasp for task in collection.tasks}
    for number, attempt in enumerate(attempts):
        end_us = attempt.rows[-1].time_us if number in empty else attempt.judged_us
        if attempt.accepted and records_none:
            first, beyond = np.searchsorted(time, [attempt.begun_us, end_us]).tolist()
            trial[first:beyond] = np.where(held[first:beyond], trial[first:beyond], number)
        before, here, after = captures[number : number + 3]
        if number + 1 in empty:
            after = max(here, int(np.searchsorted(time, attempts[number + 1].begun_us)))
        if attempt.accepted and number not in empty and before < here:
            first, beyond = _held(closed[before:after], codes[before:after], time[before:after], here - 1 - before)
            trial[before + first : before + beyond], held[before + first : before + beyond] = number, True
    labels = [(structs.replace(each.rows[-1].label, grasp=NONE), each.rows[-1].label) for each in attempts]
    rows = np.flatnonzero(trial >= 0).tolist()
    return tuple(replace(ticks[row], label=labels[trial[row]][int(held[row])]) for row in rows)


def _held(closed: NDArray[np.bool_], codes: NDArray[np.int32], time: NDArray[np.int64], here: int) -> tuple[int, int]:
    """Return the range of neighbouring rows in which the hand stays as it is in row `here`, with an exclusive end.

    It stays while at least half of the switches closed there are closed, and joints stay close.
    """
    near = np.zeros(len(time), np.bool_)
    near[here] = True
    if closed[here].any() or codes.shape[1]:
        near = 2 * (closed & closed[here]).sum(axis=1) >= closed[here].sum()
    if codes.shape[1]:
        away = np.abs(codes - codes[here]).mean(axis=1)
        near &= away <= max(_NEAR * float(np.percentile(away, 95)), _NEAR_CODES)
    ends = []
    for step, stop in ((-1, -1), (1, len(time))):
        end = row = here
        while row + step != stop and abs(row - end) <= _BRIDGED and abs(time[row + step] - time[row]) <= 2 * _TICK_US:
            row += step
            end = row if near[row] else end
        ends.append(end)
    return ends[0], ends[1] + 1


def _check_alike(parts: Sequence[_Part]) -> None:
    for part in parts[1:]:
        for thing, first, other in (
            ("switches", parts[0].session.switches, part.session.switches),
            ("taxels", parts[0].session.taxels, part.session.taxels),
            ("unit of the taxels", _taxel_unit(parts[0].session), _taxel_unit(part.session)),
            ("sensors", parts[0].session.sensors, part.session.sensors),
            ("taxonomy", _taxonomy(parts[0]), _taxonomy(part)),
            ("unit of the joints", _unit(parts[0].session), _unit(part.session)),
        ):
            if first != other:
                raise TableError(f"{part.what} and {parts[0].what} differ in {thing}: import them into separate sets")


def _taxonomy(part: _Part) -> Taxonomy:
    return Taxonomy(part.collection.taxonomy, part.collection.types)


def _unit(session: Session) -> str:
    return RAW if session.calibration is None else session.calibration.unit


def _taxel_unit(session: Session) -> str:
    return "counts" if session.taxel_calibration is None else session.taxel_calibration.unit


def _bytes_of(grasps: Sequence[tuple[_Part, _Grasp]]) -> int:
    """Return the memory that the arrays of a set of these grasps take: an array of texts is as wide as the longest."""
    session, labels = grasps[0][0].session, [grasp.label for _, grasp in grasps]
    letters = sum(max(len(getattr(label, name)) for label in labels) for name in ("grasp", "subject", "object"))
    return len(grasps) * (len(session.switches) + 2 * len(session.sensors) + 2 * len(session.taxels) + 4 * letters)


def _joined(
    grasps: Sequence[tuple[_Part, _Grasp]], stream: bool, codings: Mapping[str, BuildCalibration]
) -> tuple[GraspSet, tuple[CodingCost, ...]]:
    first = grasps[0][0]
    began = {id(part): grasp.time_us for part, grasp in reversed(grasps)}
    session = {part: str(number) for number, part in enumerate(dict.fromkeys(id(part) for part, _ in grasps), start=1)}
    trials = np.array([grasp.label.trial for _, grasp in grasps], np.int64)
    names = [name for name in first.session.sensors if name not in WRIST]
    joints = [_joint(name, grasps, trials, codings.get(name)) for name in names]
    labels = [grasp.label for _, grasp in grasps]
    closed = [0 if grasp.switches is None else grasp.switches.closed for _, grasp in grasps]
    taxels = [_taxel(place, grasps, codings) for place in range(len(first.session.taxels))]
    grasp_set = GraspSet(
        switches=switch_matrix(closed, len(first.session.switches)),
        switch_names=first.session.switches,
        codes=np.stack([codes for codes, _, _ in joints], axis=1) if joints else np.zeros((len(grasps), 0), np.uint16),
        joints=tuple(joint for _, joint, _ in joints),
        grasps=np.array([label.grasp for label in labels]),
        taxonomy=_taxonomy(first),
        subjects=np.array([label.subject for label in labels]),
        objects=np.array([label.object for label in labels]),
        trials=trials,
        taxels=np.array([codes for codes, _ in taxels], np.uint16).T if taxels else np.empty(0, np.uint16),
        taxel_columns=tuple(taxel for _, taxel in taxels),
        sessions=np.array([session[id(part)] for part, _ in grasps] if stream else [], np.str_),
        times_us=np.array([grasp.time_us - began[id(part)] for part, grasp in grasps] if stream else [], np.int64),
    )
    return grasp_set, tuple(cost for _, _, cost in joints)


def _joint(
    name: str, grasps: Sequence[tuple[_Part, _Grasp]], trials: NDArray[np.int64], target: BuildCalibration | None
) -> tuple[NDArray[np.uint16], Joint, CodingCost]:
    """Return the codes of a joint, in the coding of `target` if there is one."""
    session = grasps[0][0].session
    points, unit = _BYTES if session.calibration is None else _HALF_DEGREES, _unit(session)
    if target is not None:
        points, unit = _points(target), target.unit
    coded = BuildCalibration(0, name, unit, *structs.astuple(points))
    tables = {id(part): _byte_tables(coded, part) for part, _ in grasps}
    read = [(tables[id(part)], _raw(name, part, grasp)) for part, grasp in grasps]
    values = np.array([values[byte] for (_, values), byte in read], np.float64)
    if target is not None:  # what is beyond its codes gets the nearest, as it does live
        values = np.clip(values, *sorted(Joint(name, unit, *structs.astuple(points)).value([0, CODES - 1])))
    columns = JointColumns((name,), unit, codes=unit == RAW, calibration=points)
    _, joint, cost = code_joint(name, columns, values, trials)
    return np.array([codes[byte] for (codes, _), byte in read], np.uint16), joint, cost


def _byte_tables(coded: BuildCalibration, part: _Part) -> tuple[Sequence[int], Sequence[float]]:
    """Return the code and the value of each byte of a joint, as they would be live."""
    meaning: Meaning = part.session.calibration
    if meaning is None and coded.unit != RAW:
        device = parse_harness(part.session.harness, part.what).joint_device
        meaning = numbers_of(device.joints) if isinstance(device, StreamWiring) else None
    if meaning is None:
        return codes_of_bytes(coded, None), range(256)
    sensors = meaning if isinstance(meaning, tuple) else meaning.sensors
    line = next((line for line in sensors if line.name == coded.name), None)
    if line is None:
        raise TableError(
            f"{part.what}: its calibration has no sensor {shortened(repr(coded.name))}: `thenar calibrate` makes a "
            "whole one"
        )
    return codes_of_bytes(coded, meaning), [line.value(byte) for byte in range(256)]


def _taxel(
    place: int, grasps: Sequence[tuple[_Part, _Grasp]], codings: Mapping[str, BuildCalibration]
) -> tuple[list[int], Joint]:
    """Return the codes of a taxel: its counts, converted to the first calibration, or to its own of the `codings`."""
    first = grasps[0][0].session
    name, line = first.taxels[place], _line(first, place)
    taxel = Joint(name, "counts", 0, 0.0, 1, 1.0)
    if (target := codings.get(name)) is not None:
        taxel, line = Joint(name, target.unit, *structs.astuple(_points(target))), None
    elif line is not None:
        taxel = Joint(name, _taxel_unit(first), line.raw_a, line.value_a, line.raw_b, line.value_b)
    coded, codes = BuildCalibration(0, name, taxel.unit, *structs.astuple(_points(taxel))), []
    for part, grasp in grasps:
        count, own = grasp.counts[place], _line(part.session, place)
        assert count is not None
        code = count if own is None or own == line else code_line(coded, own).code(count)
        codes.append(min(max(code, 0), CODES - 1))
    return codes, taxel


def _line(session: Session, place: int) -> TaxelLine | None:
    return None if session.taxel_calibration is None else session.taxel_calibration.line(session.taxels[place])


def _raw(name: str, part: _Part, grasp: _Grasp) -> int:
    assert grasp.glove is not None
    return grasp.glove.sensors[part.session.sensors.index(name)]


def _points(target: BuildCalibration | Joint) -> CalibrationPoints:
    return CalibrationPoints(target.code_a, target.value_a, target.code_b, target.value_b)
