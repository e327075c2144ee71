"""An evaluation: the paper's tables for the user's own recordings."""

from dataclasses import dataclass

import numpy as np

from ..limits import check_memory, check_types
from ..placement.methods.base import METHODS
from ..recordings.graspset import GraspSet
from ..samples import Samples
from .compositions import inputs
from .concerns import concerns
from .errors import EvaluationError
from .fits import Progress, Training, is_blind, run_fits
from .plan import RIVALS, Planner, TableName
from .populations import Population, Scheme, populations
from .protocols import PROTOCOLS, ProtocolName
from .tables import Reader, Table

TABLES: tuple[TableName, ...] = ("compositions", "generality", "pruning", "baselines")

# Those with a row that is trained on all switches at once.
_OF_ALL_SWITCHES: tuple[TableName, ...] = ("compositions", "pruning")


@dataclass(frozen=True, slots=True)
class Options:
    """What to evaluate, and how.

    subjects    whose rows to use; none given: everybody's
    scheme      how rows are cut: stratified as in Weka, by block of trial numbers, or leaving out objects or subjects
    folds       of `stratified` and `block`
    repeats     of `stratified`, with seeds seed, seed + 1, ...
    prune       S of the placements of the compositions, the generality and the baselines
    prune_list  each S of the table of pooled and pruned placements
    rivals      methods that ID3 is compared with in the baselines, besides random placements
    """

    subjects: tuple[str, ...] = ()
    scheme: Scheme = "stratified"
    folds: int = 4
    repeats: int = 3
    rounds: int = 100
    prune: int = 0
    prune_list: tuple[int, ...] = (0, 13, 62)
    protocols: tuple[ProtocolName, ...] = ("paper", "honest")
    tables: tuple[TableName, ...] = TABLES
    seed: int = 1
    rivals: tuple[str, ...] = RIVALS


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A table that has no meaning for a set, and why."""

    name: TableName
    reason: str


@dataclass(frozen=True, slots=True)
class Study:
    """The result: what was asked of which set, the grasp types that occur, what to beware of, and the tables.

    left_out names the tables that were asked for but have no meaning here, with the reason.
    """

    fingerprint: str
    rows: int
    options: Options
    grasps: tuple[str, ...]
    warnings: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    tables: tuple[Table, ...]


def evaluate(
    grasp_set: GraspSet, options: Options | None = None, jobs: int = -1, progress: Progress | None = None
) -> Study:
    """Return the tables that `options` ask for and the set has the inputs for.

    The result is the same for any number of `jobs` (worker processes; -1: all cores).
    Raises EvaluationError if the set cannot be cut as asked, MemberError for a rival that is no method.
    """
    options = options or Options()
    for name in options.rivals:
        if not METHODS.named(name).by_number:
            raise EvaluationError(f"{name} takes S: a rival is a method that takes a number of switches")
    chosen = _of_subjects(grasp_set, options.subjects)
    parts = populations(chosen, options.scheme, options.folds, options.repeats, options.seed)
    reasons = {name: _why_not(name, chosen, parts, options.scheme) for name in options.tables}
    if any(reasons.get(name, "") is None for name in _OF_ALL_SWITCHES):
        _check_all_switches(chosen, parts)
    planner = Planner(
        parts,
        Samples.of(chosen, "switches"),
        len(chosen.joints),
        options.prune,
        options.prune_list,
        options.seed,
        options.rivals,
    )
    protocols = [protocol for protocol in PROTOCOLS if protocol.name in options.protocols]
    plans = [planner.table(name, each) for name, reason in reasons.items() if reason is None for each in protocols]
    fits = [fit for plan in plans for row in plan.rows for cell in row.cells for fit in cell.fits]
    X = inputs(chosen)
    predictions = run_fits(X, chosen.labels, fits, Training(options.rounds), jobs, progress)
    grasps = tuple(np.unique(chosen.labels).tolist())
    blind = frozenset(fit for fit in predictions if is_blind(X, fit))
    reader = Reader(chosen.labels, grasps, len(chosen.switch_names), predictions, blind)
    return Study(
        fingerprint=grasp_set.fingerprint(),
        rows=len(chosen),
        options=options,
        grasps=tuple(chosen.taxonomy.types[label] for label in grasps),
        warnings=concerns(chosen, parts, options.scheme, options.folds),
        left_out=tuple(LeftOut(name, reason) for name, reason in reasons.items() if reason is not None),
        tables=tuple(map(reader.table, plans)),
    )


def _of_subjects(grasp_set: GraspSet, subjects: tuple[str, ...]) -> GraspSet:
    if not len(grasp_set):
        raise EvaluationError("the set has no rows: nothing to evaluate")
    known = np.unique(grasp_set.subjects).tolist()
    unknown = [name for name in subjects if name not in known]
    if unknown:
        raise EvaluationError(f"no subject {unknown[0]!r} in the set; its subjects are {', '.join(known)}")
    chosen = grasp_set.rows(np.isin(grasp_set.subjects, subjects)) if subjects else grasp_set
    types = len(np.unique(chosen.labels))
    check_types(types, EvaluationError)
    check_memory(len(chosen), types, EvaluationError)
    return chosen


def _check_all_switches(grasp_set: GraspSet, parts: tuple[Population, ...]) -> None:
    """Raise EvaluationError where a training on all switches has no room in memory: before placements are chosen."""
    switches = grasp_set.switches
    varying = int(np.count_nonzero(switches.any(axis=0) & ~switches.all(axis=0)))
    for part in parts:
        rows = max((len(fold.train) for fold in part.folds), default=0)
        check_memory(rows, len(part.grasps), EvaluationError, varying)


def _why_not(name: TableName, grasp_set: GraspSet, parts: tuple[Population, ...], scheme: Scheme) -> str | None:
    """Return why a table has no meaning for the set and the cut, or None."""
    if name != "compositions" and not grasp_set.switch_names:
        return "a placement needs switches, and the set has none"
    if name == "generality" and len(parts) < 2:
        return "another's placement needs a second subject"
    if name == "generality" and scheme == "subject":
        return "when a subject is left out, the placement always is others'"
    return None
