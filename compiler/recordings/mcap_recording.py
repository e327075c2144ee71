"""Recordings of guided collections (MCAP) into a `GraspSet`: a row for every trial that was accepted.

A row is what the devices had delivered last when the grasp was captured. The CyberGlove's sensors but the wrist's,
which the paper does not use either, become joints: raw bytes where the glove was not calibrated, half degrees on one
scale for all subjects where it was. Taxels keep their counts, what their baselines moved taken off; where they were
calibrated, the counts of all are those of the first calibration.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.names import SHOWN, shortened
from thenar.runtime.recording.messages import switch_matrix
from thenar.runtime.recording.reader import Reader, check_made
from thenar.runtime.recording.session import Collection, Label, Session
from thenar.runtime.taxels import TaxelLine, Taxels

from .coding import CodingCost, code_joint
from .columns import Calibration, JointColumns
from .errors import ColumnsError, TableError, list_rows
from .graspset import CODES, GraspSet, Joint
from .importer import ImportReport, import_file, import_table, report_of
from .propose import propose_file
from .summary import Finding, find_oddities
from .taxonomy import Taxonomy

WRIST = ("wrist_pitch", "wrist_yaw")
# Half degrees, the paper's resolution, from further down than a calibrated hand reaches.
_HALF_DEGREES = Calibration(code_a=0, value_a=-250.0, code_b=1000, value_b=250.0)
_BYTES = Calibration(code_a=1, value_a=1.0, code_b=255, value_b=255.0)


@dataclass(frozen=True, slots=True)
class _Grasp:
    """An accepted trial and the frames that were captured; counts are the taxels', None for one with a fault."""

    label: Label
    switches: SwitchFrame | None
    glove: GloveFrame | None
    counts: tuple[int | None, ...] = ()

    def whole(self, session: Session) -> bool:
        """Return whether everything that the session records was read."""
        read = self.switches is not None and not self.switches.lost | self.switches.unread
        read = read and len(self.counts) == len(session.taxels) and None not in self.counts
        return (read or not (session.switches or session.taxels)) and (self.glove is not None or not session.sensors)


@dataclass(frozen=True, slots=True)
class _Part:
    """What one session brought."""

    what: str
    session: Session
    collection: Collection
    grasps: tuple[_Grasp, ...]


def import_files(paths: Sequence[Path], columns: Path | None = None) -> tuple[GraspSet, ImportReport]:
    """Import one table as the columns.toml in file `columns` says, or recordings, which say themselves what they hold.

    Without `columns`, what the columns of a table are is found from their names and values.

    Raises TableError, ColumnsError, RecordingError or McapError, naming file, rows and columns; OSError as it comes.
    """
    if all(path.suffix.lower() == ".mcap" for path in paths):
        if columns is not None:
            raise ColumnsError(f"a recording says itself what its columns are: leave {columns.name} out")
        return import_recordings(paths)
    if len(paths) > 1:
        raise TableError("several recordings (.mcap) can be imported together, but only one table")
    if columns is None:
        table, proposal = propose_file(paths[0])
        if proposal.lacks:
            raise ColumnsError(f"{paths[0].name}: {proposal.lacks}, in a columns.toml")
        return import_table(table, proposal.columns)
    return import_file(paths[0], columns)


def import_recordings(paths: Sequence[Path]) -> tuple[GraspSet, ImportReport]:
    """Import the accepted trials of recordings of one glove and one taxonomy; subjects may differ.

    Raises McapError, TableError or RecordingError naming the file; OSError as it comes.
    """
    parts: list[_Part] = []
    findings: list[Finding] = []
    size = 0
    for path in paths:
        reader = Reader(path)
        parts += _parts(reader)
        findings += [Finding(fault.kind, fault.count, fault.message) for fault in reader.faults()]
        size += reader.end.size if reader.end is not None else 0
    what = ", ".join(path.name for path in paths)
    _check_alike(parts)
    grasps = [(part, grasp) for part in parts for grasp in part.grasps if grasp.whole(part.session)]
    findings += _left_out(parts)
    if not grasps:
        raise TableError(f"{what}: no trial was accepted; `thenar record` makes recordings with labelled trials")
    check_made(f"{what}: its trials", _bytes_of(grasps), size)
    grasp_set, costs = _joined(grasps)
    return grasp_set, report_of(what, grasp_set, costs, (*findings, *find_oddities(grasp_set, grasp_set.trials)))


def _parts(reader: Reader) -> Iterator[_Part]:
    """Yield every session with trials; those without are not labelled and bring nothing."""
    grasps: list[_Grasp] = []
    for session, grasp in _accepted(reader):
        if grasp is not None:
            grasps.append(grasp)
        elif session.collection is not None and grasps:
            yield _Part(reader.path.name, session, session.collection, tuple(grasps))
            grasps = []


def _accepted(reader: Reader) -> Iterator[tuple[Session, _Grasp | None]]:
    """Yield the accepted grasps, each with its session, and (session, None) at every session's end."""
    switches: SwitchFrame | None = None
    glove: GloveFrame | None = None
    captured: _Grasp | None = None
    session, taxels = reader.session, _taxels(reader)
    for entry in reader:
        if isinstance(entry, Session):
            yield session, None
            session, switches, glove, captured, taxels = entry, None, None, None, _taxels(reader)
        elif isinstance(entry, SwitchFrame):
            switches = entry
            taxels.read(entry.time_us, entry.taxels or [None] * len(session.taxels))
        elif isinstance(entry, GloveFrame):
            glove = entry
        elif isinstance(entry, Label):
            if entry.event == "accepted" and captured is not None and captured.label.trial == entry.trial:
                yield session, captured
            counts = tuple(taxels.counts)
            captured = _Grasp(entry, switches, glove, counts) if entry.event == "captured" else None
    yield session, None


def _taxels(reader: Reader) -> Taxels:
    """Return the taxels of the session that begins, whose baselines are followed as they were live."""
    session = reader.session
    settings = parse_harness(session.harness, reader.path.name).taxel_settings if session.taxels else None
    return Taxels(session.taxels, [[]] * len(session.taxels), session.taxel_calibration, settings)


def _left_out(parts: Sequence[_Part]) -> Iterator[Finding]:
    trials = [grasp.label.trial for part in parts for grasp in part.grasps if not grasp.whole(part.session)]
    if trials:
        message = f"{len(trials)} trials in which not everything was read were left out: {list_rows(np.array(trials))}"
        yield Finding("dropped rows", len(trials), message, tuple(trials[:SHOWN]))


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
                raise TableError(
                    f"{part.what} and {parts[0].what} differ in {thing}: import them into sets of their own"
                )


def _taxonomy(part: _Part) -> Taxonomy:
    return Taxonomy(part.collection.taxonomy, part.collection.types)


def _unit(session: Session) -> str:
    return "raw" if session.calibration is None else session.calibration.unit


def _taxel_unit(session: Session) -> str:
    return "counts" if session.taxel_calibration is None else session.taxel_calibration.unit


def _bytes_of(grasps: Sequence[tuple[_Part, _Grasp]]) -> int:
    """Return how much memory the arrays of a set of these grasps take: an array of texts is as wide as its longest."""
    session, labels = grasps[0][0].session, [grasp.label for _, grasp in grasps]
    letters = sum(max(len(getattr(label, name)) for label in labels) for name in ("grasp", "subject", "object"))
    return len(grasps) * (len(session.switches) + 2 * len(session.sensors) + 2 * len(session.taxels) + 4 * letters)


def _joined(grasps: Sequence[tuple[_Part, _Grasp]]) -> tuple[GraspSet, tuple[CodingCost, ...]]:
    first = grasps[0][0]
    trials = np.array([grasp.label.trial for _, grasp in grasps], np.int64)
    joints = [_joint(name, grasps, trials) for name in first.session.sensors if name not in WRIST]
    labels = [grasp.label for _, grasp in grasps]
    closed = [0 if grasp.switches is None else grasp.switches.closed for _, grasp in grasps]
    taxels = [_taxel(place, grasps) for place in range(len(first.session.taxels))]
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
    )
    return grasp_set, tuple(cost for _, _, cost in joints)


def _joint(
    name: str, grasps: Sequence[tuple[_Part, _Grasp]], trials: NDArray[np.int64]
) -> tuple[NDArray[np.uint16], Joint, CodingCost]:
    unit = _unit(grasps[0][0].session)
    calibrated = grasps[0][0].session.calibration is not None
    values = np.array([_value(name, part, grasp) for part, grasp in grasps], np.float64)
    scale = _HALF_DEGREES if calibrated else _BYTES
    return code_joint(name, JointColumns((name,), unit, codes=not calibrated, calibration=scale), values, trials)


def _taxel(place: int, grasps: Sequence[tuple[_Part, _Grasp]]) -> tuple[list[int], Joint]:
    """Return the codes of a taxel: its counts; of another calibration than the first, what means the same there."""
    first = grasps[0][0].session
    name, line = first.taxels[place], _line(first, place)
    taxel = Joint(name, "counts", 0, 0.0, 1, 1.0)
    if line is not None:
        taxel = Joint(name, _taxel_unit(first), line.rest, 0.0, line.press, line.value)
    codes = []
    for part, grasp in grasps:
        count, own = grasp.counts[place], _line(part.session, place)
        assert count is not None
        code = count if own is None or own == line else round(float(taxel.code(own.at(count))))
        codes.append(min(max(code, 0), CODES - 1))
    return codes, taxel


def _line(session: Session, place: int) -> TaxelLine | None:
    return None if session.taxel_calibration is None else session.taxel_calibration.line(session.taxels[place])


def _value(name: str, part: _Part, grasp: _Grasp) -> float:
    assert grasp.glove is not None
    raw = grasp.glove.sensors[part.session.sensors.index(name)]
    calibration = part.session.calibration
    if calibration is None:
        return raw
    line = next((line for line in calibration.sensors if line.name == name), None)
    if line is None:
        raise TableError(
            f"{part.what}: its calibration has no sensor {shortened(repr(name))}: `thenar calibrate` makes a whole one"
        )
    return line.value(raw)
