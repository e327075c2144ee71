"""`compile_build`: recordings in, a build folder out."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ...runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, TABLES_NAME
from ...runtime.manifest import (
    SCHEMA,
    Calibration,
    Inputs,
    Manifest,
    Options,
    Proof,
    Recognised,
    Source,
    Switch,
    manifest_from_bytes,
    manifest_to_bytes,
)
from ...runtime.tables import IntegerTables, tables_to_bytes
from ..evaluation.folds import check_cut
from ..recordings.graspset import GraspSet
from ..tables.collapse import collapse
from ..tables.compare import Comparison, compare
from ..tables.quantise import quantise
from .ensemble import ensemble_to_bytes
from .recognition import cross_validated
from .staging import check_target, publish
from .training import Material, Trained, material_of, train

WIDTH = 16


@dataclass(frozen=True, slots=True, eq=False)
class BuildReport:
    """Where the build is, what its `build.json` says of it, and the one grasp type that it gives all rows, if it does:
    then the inputs tell nothing that stumps, which add up, can tell.
    """

    folder: Path
    manifest: Manifest
    tables_bytes: int
    only_answer: str | None


def compile_build(
    grasp_set: GraspSet,
    folder: str | Path,
    *,
    prune: int = 0,
    rounds: int = 100,
    inputs: Inputs = "both",
    shrinkage: float = 1.0,
    tolerance: float | None = None,
    folds: int = 4,
    seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> BuildReport:
    """Choose the placement, train, collapse, quantise, prove, and write the build `folder`, whole or not at all.

    prune is the paper's S, inputs which of switches and joints to use; a round that changes the mean loss by less than
    tolerance is the last; folds and seed cut the cross-validation whose rate goes into the build (0 folds: none).
    progress(done, total) is called as work is done. The same recordings and options give the same bytes. Raises
    CompileError, or what placement and boosting raise of their options.
    """
    target = check_target(Path(folder))
    least = None if tolerance is None else float(tolerance)
    options = Options(prune, rounds, inputs, float(shrinkage), folds, seed, least)
    material = material_of(grasp_set, options)
    if folds:
        check_cut(len(grasp_set), folds, "rows")
    steps = _Steps(progress, rounds, folds)
    trained = train(material, options, steps.round_done)
    bits = trained.kept(material)
    integers = quantise(collapse(trained.stumps, len(trained.columns)), bits, material.codes, WIDTH)
    comparison = compare(trained.stumps, integers, bits, material.codes)
    rates = [_training_rate(comparison, material, options)]
    if folds:
        rates.append(cross_validated(material, options, steps.fold_done))
    tables, ensemble = tables_to_bytes(integers), ensemble_to_bytes(trained.stumps)
    manifest = Manifest(
        schema=SCHEMA,
        checksum="",
        thenar=version("thenar"),
        tables_sha256=hashlib.sha256(tables).hexdigest(),
        ensemble_sha256=hashlib.sha256(ensemble).hexdigest(),
        source=_source(grasp_set),
        options=options,
        grasps=material.grasps,
        switches=_switches(grasp_set, trained),
        joints=_joints(grasp_set) if inputs != "switches" else (),
        proof=_proof(integers, comparison),
        rates=tuple(rates),
        stopped_after=trained.stumps.n_rounds if trained.stopped_early else 0,
        zero_gain_nodes=trained.zero_gain_nodes,
    )
    described = manifest_to_bytes(manifest)
    publish({TABLES_NAME: tables, ENSEMBLE_NAME: ensemble, MANIFEST_NAME: described}, target)
    answers = np.unique(comparison.deployed)
    only_answer = material.grasps[answers[0]] if len(answers) == 1 else None
    return BuildReport(target, manifest_from_bytes(described), len(tables), only_answer)


class _Steps:
    """Work done, counted in boosting rounds: one training on all rows, one for each fold."""

    def __init__(self, report: Callable[[int, int], None] | None, rounds: int, folds: int) -> None:
        self._report, self._rounds, self._folds = report, rounds, folds

    def round_done(self, done: int, _rounds: int) -> None:
        if self._report is not None:
            self._report(done, self._rounds * (1 + self._folds))

    def fold_done(self, done: int, _folds: int) -> None:
        self.round_done(self._rounds * (1 + done), self._rounds)


def _source(grasp_set: GraspSet) -> Source:
    return Source(
        fingerprint=grasp_set.fingerprint(),
        rows=len(grasp_set),
        taxonomy=grasp_set.taxonomy.name,
        switches=len(grasp_set.switch_names),
        simulated=grasp_set.simulated,
    )


def _switches(grasp_set: GraspSet, trained: Trained) -> tuple[Switch, ...]:
    pairs = zip(trained.columns, trained.gains, strict=True)
    return tuple(Switch(column, grasp_set.switch_names[column], gain) for column, gain in pairs)


def _joints(grasp_set: GraspSet) -> tuple[Calibration, ...]:
    return tuple(
        Calibration(column, joint.name, joint.unit, joint.code_a, joint.value_a, joint.code_b, joint.value_b)
        for column, joint in enumerate(grasp_set.joints)
    )


def _proof(integers: IntegerTables, comparison: Comparison) -> Proof:
    return Proof(
        width=WIDTH,
        scale=integers.scale,
        bound=integers.bound,
        error=comparison.integer_bound,
        safe_margin=comparison.safe_margin,
        covered=int(np.count_nonzero(comparison.covered)),
        changed=len(comparison.changed),
    )


def _training_rate(comparison: Comparison, material: Material, options: Options) -> Recognised:
    correct = int(np.count_nonzero(comparison.deployed == material.labels))
    return Recognised("training", 0, options.seed, correct, len(material.labels))
