"""`verify`: compare what is deployed with what was trained, on every recorded row and in the worst frame."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.build import ENSEMBLE_NAME, Build, read_member
from thenar.runtime.errors import BuildError
from thenar.runtime.manifest import Faults, Unit
from thenar.runtime.published import LiveGrasp

from ..evaluation.rates import rated
from ..model.compare import WorstCase, compare, worst_case
from ..model.faults import count_faults, groups_of, worst_faults
from ..recogniser import predicted_classes
from ..recordings.graspset import GraspSet
from ..samples import select_inputs
from ..scan_file import load_scan
from ..trainers.base import Model, Report
from ..trainers.stumps import Stumps
from . import CompileError
from .ensemble import MAX_BYTES, ensemble_from_bytes, model_fault
from .training import trained_on
from .verify_firmware import FirmwareVerification, verify_firmware


class ChangedRow(Struct, frozen=True):
    """A row, counted from 0, whose grasp type changes: as recorded, by the ensemble, by the integers."""

    row: int
    recorded: str
    ensemble: str
    integers: str
    margin: float


class Counted(Struct, frozen=True):
    """The number of correct trials (majority of frames) or frames, of `total`, by the ensemble and by the integers.

    `low` and `high` bound the 95 % interval of the accuracy of the integers.
    """

    unit: Unit
    total: int
    ensemble: int
    integers: int
    low: float
    high: float

    @property
    def rate(self) -> float:
        """The accuracy of the integers."""
        return self.integers / self.total


class NothingHeld(Struct, frozen=True):
    """How many rows show grasps, and how many of these are predicted as nothing held; the same for rows in which
    nothing is held.
    """

    grasps: int
    missed: int
    empty: int
    detected: int


class Verification(Struct, frozen=True, kw_only=True):
    """The result of verification on `rows` rows: differences, and the bounds that they must keep.

    collapse_* compare the ensemble with the float tables, in units of score; integer_* the float tables with the
    integers, in steps. covered counts rows whose margin exceeds safe_margin, covered_changed those of them that change.
    recognised counts trials of grasps, and frames where trials have several; independent says that each recorded row is
    a trial. The build was trained on trained_on of the trials. nothing_held is present if the build can predict that
    nothing is held. worst looks beyond the rows; firmware is present if requested.
    """

    rows: int
    trials: int
    trained_on: int
    independent: bool
    collapse_difference: float
    collapse_bound: float
    integer_difference: float
    integer_bound: float
    safe_margin: float
    covered: int
    covered_changed: int
    recognised: tuple[Counted, ...]
    worst: WorstCase
    changed: tuple[ChangedRow, ...]
    holds: bool
    firmware: FirmwareVerification | None = None
    nothing_held: NothingHeld | None = None


def verify(
    folder: str | Path,
    grasp_set: GraspSet,
    firmware: Sequence[str] = (),
    progress: Report | None = None,
) -> Verification:
    """Compare a build's model, float tables and integer tables on every row of recordings, and over all frames.

    Parameters
    ----------
    folder : path
        The build.
    grasp_set : GraspSet
        Any recordings with the inputs of the build. Columns are found by name.
    firmware : sequence of {"host", "avr", "micropython"}
        Targets to compile the classifier for, to compare its scores with those of Python.
    progress : callable, optional
        Called with (done, total) after blocks of rows and compiled classifiers.

    Returns
    -------
    Verification
        Differences and the bounds that they must keep; `holds` is true if they do.

    Raises
    ------
    BuildError, FormatError
        If the folder is not a valid build.
    CompileError
        If the recordings lack inputs of the build, or have no rows.
    FirmwareError
        If a tool is missing, or the build does not fit a part.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, compile_build, verify
    >>> grasp_set = GraspSet.load("set.grasps")
    >>> report = compile_build(grasp_set, "build", rounds=5, folds=0)
    >>> verify("build", grasp_set).holds
    True
    """
    build = _build_for(folder, grasp_set)
    model = load_ensemble(Path(folder), build)
    bits, codes = select_inputs(grasp_set, build.manifest)
    comparison = compare(model, build.tables, bits, codes, progress)
    names = [switch.name for switch in build.manifest.switches]
    worst = worst_case(model, build.tables, comparison, build.grasps, names)
    grasps, empty = np.array(build.grasps), grasp_set.is_none
    predicted = predicted_classes(build.tables, build.manifest.rejection, bits, codes)
    number = build.none if build.scorer.rejector is None else len(grasps)
    nothing_held = None
    if number is not None:
        detected = predicted == number
        counts = map(np.count_nonzero, (~empty, detected & ~empty, empty, detected & empty))
        nothing_held = NothingHeld(*map(int, counts))
    seen = trained_on(build.manifest, grasp_set)
    compiled = verify_firmware(folder, grasp_set, firmware, progress) if firmware else None
    return Verification(
        rows=len(grasp_set),
        trials=len(seen),
        trained_on=int(np.count_nonzero(seen)),
        independent=grasp_set.independent,
        collapse_difference=comparison.collapse_difference,
        collapse_bound=comparison.collapse_bound,
        integer_difference=comparison.integer_difference,
        integer_bound=comparison.integer_bound,
        safe_margin=comparison.safe_margin,
        covered=int(np.count_nonzero(comparison.covered)),
        covered_changed=int(np.count_nonzero(comparison.covered[comparison.changed])),
        recognised=_recognised(comparison.trained, predicted, grasps, grasp_set),
        worst=worst,
        changed=tuple(
            ChangedRow(
                row=int(row),
                recorded=str(grasp_set.grasps[row]),
                ensemble=str(grasps[comparison.trained[row]]),
                integers=str(grasps[comparison.deployed[row]]),
                margin=float(comparison.margins[row]),
            )
            for row in comparison.changed
        ),
        holds=comparison.holds and worst.holds and (compiled is None or compiled.holds),
        nothing_held=nothing_held,
        firmware=compiled,
    )


def _build_for(folder: str | Path, grasp_set: GraspSet) -> Build:
    if not len(grasp_set):
        raise CompileError("the recordings have no rows: there is nothing to verify")
    return Build.load(folder)


class InputFaults(Struct, frozen=True):
    """The number of correct trials with an input lost, and with it stuck at the value that does the most harm."""

    name: str
    lost: int
    stuck: int
    value: str


class FaultCheck(Struct, frozen=True):
    """The effect of faults on these recordings: the worst of each kind, and each input."""

    worst: Faults
    inputs: tuple[InputFaults, ...]


def verify_faults(folder: str | Path, grasp_set: GraspSet, progress: Report | None = None) -> FaultCheck:
    """Simulate every fault of an input, and of the build's ports, chips and boards, on every row of recordings.

    Parameters
    ----------
    folder : path
        The build.
    grasp_set : GraspSet
        Any recordings with the inputs of the build. Columns are found by name.
    progress : callable, optional
        Called with (done, total) after blocks of rows.

    Returns
    -------
    FaultCheck
        Counts of correct trials; the majority of a trial's frames decides.

    Raises
    ------
    BuildError, FormatError
        If the folder is not a valid build.
    CompileError
        If the recordings lack inputs of the build, or have no rows.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, compile_build, verify_faults
    >>> grasp_set = GraspSet.load("set.grasps")
    >>> report = compile_build(grasp_set, "build", rounds=5, folds=0)
    >>> verify_faults("build", grasp_set).worst == report.manifest.faults
    True
    """
    grasp_set = grasp_set.without_none()
    build = _build_for(folder, grasp_set)
    manifest = build.manifest
    bits, codes = select_inputs(grasp_set, manifest)
    scan, sources = load_scan(Path(folder), manifest), [switch.source for switch in manifest.switches]
    groups = groups_of(scan, sources, build.tables.n_joints)
    labels = labels_of(np.array(build.grasps), grasp_set)
    counts = count_faults(build.tables, bits, codes, labels, grasp_set.trial_ids, tuple(groups.values()), progress)
    names = [*(each.name for each in manifest.switches), *(each.name for each in manifest.joints)]
    stuck = (
        min(zip(*each, strict=True), key=lambda one: one[0]) for each in zip(counts.stuck, counts.values, strict=True)
    )
    return FaultCheck(
        worst_faults(counts, names, groups),
        tuple(
            InputFaults(name, lost, left, value)
            for name, lost, (left, value) in zip(names, counts.lost, stuck, strict=True)
        ),
    )


def labels_of(grasps: NDArray[np.str_], grasp_set: GraspSet) -> NDArray[np.intp]:
    """Return the class of each row (n,); types that the build does not know get a number beyond its classes."""
    known = np.append(grasp_set.grasps[:, None] == grasps, np.ones((len(grasp_set), 1), bool), axis=1)
    return np.asarray(known.argmax(axis=1))


def load_ensemble(folder: Path, build: Build) -> Model:
    """Return the model of the build in `folder`. Raises BuildError or FormatError."""
    path = folder / ENSEMBLE_NAME
    model = ensemble_from_bytes(read_member(path, MAX_BYTES, build.manifest.ensemble_sha256), str(path))
    tables, fit = build.tables, build.manifest.fit
    foreign = bool(model_fault(model, tables.n_switches, tables.n_joints, tables.n_classes))
    if isinstance(model, Stumps):
        foreign |= model.shrinkage != fit.settings.get("shrinkage") or model.n_rounds > fit.number("rounds")
    if foreign:
        raise BuildError(f"{path} belongs to another build: compile the build again")
    return model


def _recognised(
    trained: NDArray[np.intp], deployed: NDArray[np.intp], grasps: NDArray[np.str_], grasp_set: GraspSet
) -> tuple[Counted, ...]:
    labels, held = labels_of(grasps, grasp_set), ~grasp_set.is_none
    # The number of an unknown type must differ from the one of rejected frames.
    labels[labels == len(grasps)] = len(grasps) + 1
    if not held.any():
        return ()
    both = [rated(found[held], labels[held], grasp_set.trial_ids[held], of="pooled") for found in (trained, deployed)]
    return tuple(
        Counted(one.unit, one.total, one.correct[0], other.correct[0], other.low, other.high)
        for one, other in zip(*both, strict=True)
        if one is not None and other is not None
    )


def replayed(build: Build, grasp_set: GraspSet, period_us: int) -> Iterator[LiveGrasp]:
    """Yield the prediction for each row. Both clocks begin with the set.

    Raises CompileError if the set lacks inputs of the build.
    """
    bits, codes = select_inputs(grasp_set, build.manifest)
    for row, (switches, joints) in enumerate(zip(bits, codes, strict=True)):
        prediction = build.recognise(switches, joints)
        yield LiveGrasp(
            time_us=row * period_us,
            unix_us=row * period_us,
            number=row,
            grasp=prediction.grasp,
            candidate=prediction.grasp,
            probability=prediction.probability,
            margin=prediction.margin,
            health="degraded" if prediction.degraded else "ok",
            switch_age_us=None,
            glove_age_us=None,
            latency_us=0,
        )
