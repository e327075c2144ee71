"""`verify_build`: is what runs what was trained, on every row of these recordings and in the worst frame there is?"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from msgspec import Struct
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.runtime.build import ENSEMBLE_NAME, Build, read_member
from thenar.runtime.errors import BuildError
from thenar.runtime.tables import LIMIT

from ..boosting.stumps import TIE, Stumps
from ..recordings.graspset import GraspSet
from ..tables.collapse import Model, collapse
from ..tables.compare import Comparison, compare
from ..tables.furthest import furthest
from ..tables.worstcase import Rounding
from .ensemble import MAX_BYTES, ensemble_from_bytes, model_fault
from .errors import CompileError
from .scanned import ScanCheck, check_scan
from .select import select_inputs
from .verify_firmware import FirmwareVerification


class ChangedRow(Struct, frozen=True):
    """A row, from 0, that the integers give another grasp type: recorded, by the ensemble, by the integers."""

    row: int
    recorded: str
    ensemble: str
    integers: str
    margin: float


class WorstCase(Struct, frozen=True, kw_only=True):
    """What integers can do at worst, in steps, exactly and over every frame there is, recorded or not.

    In the frame `closed` (names of kept switches) and `codes`, the lead of grasp type `leader` over `rival` loses most.
    A margin above safe_margin keeps its grasp type: true of `covered` rows, of which `covered_changed` change all the
    same. `reach` is the furthest that a sum gets from zero, in any order, whole or with inputs missing: for `reaching`.
    """

    leader: str
    rival: str
    loss: float
    bound: float
    closed: tuple[str, ...]
    codes: tuple[int, ...]
    safe_margin: float
    covered: int
    covered_changed: int
    reaching: str
    reach: int
    limit: int = LIMIT

    @property
    def holds(self) -> bool:
        """Whether no lead can lose more than the bound, and no covered row changes."""
        return self.loss <= self.bound and not self.covered_changed


class Verification(Struct, frozen=True, kw_only=True):
    """What verification found on `rows` rows; differences beside the bounds that they must keep.

    collapse_* compare the ensemble with the float tables, in units of score; integer_* the float tables with the
    integers, in steps. covered counts rows whose margin exceeds safe_margin, covered_changed those of them that change.
    worst looks beyond the rows; scan is there if the build says how to read a harness, firmware if it was asked for.
    """

    same_recordings: bool
    rows: int
    collapse_difference: float
    collapse_bound: float
    integer_difference: float
    integer_bound: float
    safe_margin: float
    covered: int
    covered_changed: int
    correct_ensemble: int
    correct_integers: int
    worst: WorstCase
    changed: tuple[ChangedRow, ...]
    scan: ScanCheck | None
    holds: bool
    firmware: FirmwareVerification | None = None

    def with_firmware(self, firmware: FirmwareVerification) -> "Verification":
        """Return the same with what was found of compiled classifiers, which must hold too."""
        return replace(self, firmware=firmware, holds=self.holds and firmware.holds)


def verify_build(
    folder: str | Path, grasp_set: GraspSet, progress: Callable[[int, int], None] | None = None
) -> Verification:
    """Compare ensemble, float tables and integer tables on every row of `grasp_set`, compiled from or not, and beyond.

    Columns are found by name. Raises BuildError or SealError for a folder that is no sound build, CompileError for
    recordings that lack its inputs.
    """
    if not len(grasp_set):
        raise CompileError("the recordings have no rows: there is nothing to verify")
    build = Build.load(folder)
    model = _load_ensemble(Path(folder), build)
    bits, codes = select_inputs(grasp_set, build.manifest)
    comparison = compare(model, build.tables, bits, codes, progress)
    worst = _worst(model, build, comparison)
    scan = None if build.scan is None else check_scan(build.scan, build.tables, bits, codes, comparison.deployed)
    grasps = np.array(build.grasps)
    return Verification(
        same_recordings=grasp_set.fingerprint() == build.manifest.source.fingerprint,
        rows=len(grasp_set),
        collapse_difference=comparison.collapse_difference,
        collapse_bound=comparison.collapse_bound,
        integer_difference=comparison.integer_difference,
        integer_bound=comparison.integer_bound,
        safe_margin=comparison.safe_margin,
        covered=int(np.count_nonzero(comparison.covered)),
        covered_changed=int(np.count_nonzero(comparison.covered[comparison.changed])),
        correct_ensemble=int(np.count_nonzero(grasps[comparison.trained] == grasp_set.grasps)),
        correct_integers=int(np.count_nonzero(grasps[comparison.deployed] == grasp_set.grasps)),
        worst=worst,
        changed=_changed(comparison, grasps, grasp_set),
        scan=scan,
        holds=comparison.holds and worst.holds and not (scan and scan.changed),
    )


def _load_ensemble(folder: Path, build: Build) -> Model:
    path = folder / ENSEMBLE_NAME
    model = ensemble_from_bytes(read_member(path, MAX_BYTES, build.manifest.ensemble_sha256), str(path))
    tables, options = build.tables, build.manifest.options
    foreign = bool(model_fault(model, tables.n_switches, tables.n_joints, tables.n_classes))
    if isinstance(model, Stumps):
        foreign |= model.shrinkage != options.shrinkage or model.n_rounds > options.rounds
    if foreign:
        raise BuildError(f"{path} is the ensemble of another build: compile the build again")
    return model


def _worst(model: Model, build: Build, comparison: Comparison) -> WorstCase:
    integers = build.tables
    rounding = Rounding(collapse(model, integers.n_switches), integers)
    frame, furthest_sum = rounding.worst_of_all(), furthest(integers)
    safe = float(rounding.safe_margin())
    # Scores that the ensemble takes for tied are decided by the number of the class.
    covered = comparison.margins > max(safe, TIE * integers.scale) + 2 * comparison.slack
    return WorstCase(
        leader=build.grasps[frame.leader],
        rival=build.grasps[frame.rival],
        loss=float(frame.loss),
        bound=comparison.safe_margin + 2 * comparison.slack,
        closed=tuple(s.name for s, bit in zip(build.manifest.switches, frame.bits.tolist(), strict=True) if bit),
        codes=tuple(frame.codes.tolist()),
        safe_margin=safe,
        covered=int(np.count_nonzero(covered)),
        covered_changed=int(np.count_nonzero(covered[comparison.changed])),
        reaching=build.grasps[furthest_sum.grasp],
        reach=furthest_sum.total,
    )


def _changed(comparison: Comparison, grasps: NDArray[np.str_], grasp_set: GraspSet) -> tuple[ChangedRow, ...]:
    return tuple(
        ChangedRow(
            row=int(row),
            recorded=str(grasp_set.grasps[row]),
            ensemble=str(grasps[comparison.trained[row]]),
            integers=str(grasps[comparison.deployed[row]]),
            margin=float(comparison.margins[row]),
        )
        for row in comparison.changed
    )
