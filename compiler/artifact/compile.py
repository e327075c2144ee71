"""`compile_build`: recordings in, a build folder out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from thenar.runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, SCAN_NAME, TABLES_NAME
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import Inputs, Manifest, Options, TableBits, manifest_from_bytes, manifest_to_bytes
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.scanmap import ScanMap, scanmap_to_bytes
from thenar.runtime.tables import IntegerTables, tables_to_bytes

from ..evaluation.folds import check_cut
from ..placement.ports import PortCosts, ports_of_whole_glove
from ..recordings.graspset import GraspSet
from ..samples import Samples
from ..tables.collapse import collapse
from ..tables.compare import Comparison, compare
from ..tables.quantise import quantise
from .carried import made_firmware
from .describing import describe
from .ensemble import ensemble_to_bytes
from .errors import CompileError
from .made import Documents, Made, no_documents
from .recognition import cross_validated
from .staging import check_target, publish
from .training import Trained, check_placement, material_of, train

# A wiring, or what makes one for the names of the kept switches.
Wired = Harness | Callable[[Sequence[str]], Harness]


@dataclass(frozen=True, slots=True, eq=False)
class BuildReport:
    """Where the build is, what its `build.json` says of it, how to read the harness it was compiled for, if it was for
    one, and the one grasp type that it gives all rows, if it does: then the inputs tell nothing that stumps, which add
    up, can tell. `firmware` is a sentence: what its firmware is laid out for, or why there is none. `harness` is the
    wiring that `scan` reads.
    """

    folder: Path
    manifest: Manifest
    tables_bytes: int
    only_answer: str | None
    firmware: str
    scan: ScanMap | None = None
    harness: Harness | None = None


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
    table_bits: TableBits = 16,
    max_bins: int | None = None,
    placement: str = "id3",
    keep: int | None = None,
    width: int = 16,
    harness: Wired | None = None,
    ports: PortCosts | None = None,
    documents: Documents = no_documents,
    progress: Callable[[int, int], None] | None = None,
) -> BuildReport:
    """Choose the placement, train, collapse, quantise, prove, and write the build `folder`, whole or not at all.

    prune is the paper's S, inputs which of switches and joints to use; a round that changes the mean loss by less than
    tolerance is the last; folds and seed cut the cross-validation whose rate goes into the build (0 folds: none).
    With table_bits 8, steps are coarse enough for firmware with 8-bit entries (quantise); with max_bins, no joint has
    more bins than that, so that tables stay small; no sum needs more than `width` bits, 4 to 16. `placement` is a
    name of METHODS, `keep` how many switches it keeps, where it is not pruned by S.
    `ports` say what reading each switch costs, for methods that ask (None: on a glove of as few MCP23017 as will do).
    With a harness, the build says how to read its switches there; `documents` go into the folder with it.
    progress(done, total) is called as work is done. The same recordings, options and harness give the same bytes.
    Raises CompileError, HarnessError if the harness lacks a kept switch, or what placement and boosting raise of their
    options.
    """
    target = check_target(Path(folder))
    least = None if tolerance is None else float(tolerance)
    options = Options(
        prune, rounds, inputs, float(shrinkage), folds, seed, least, table_bits, max_bins, placement, keep, width
    )
    _check(options)
    samples = material_of(grasp_set, options)
    if folds:
        check_cut(len(grasp_set), folds, "rows")
    steps = _Steps(progress, rounds, folds)
    ports = ports or ports_of_whole_glove(None, grasp_set.switch_names)
    trained = train(samples, options, steps.round_done, ports)
    bits = trained.kept(samples)
    integers = quantise(collapse(trained.stumps, len(trained.columns)), bits, samples.codes, width, table_bits)
    names = [grasp_set.switch_names[column] for column in trained.columns]
    wired = harness(names) if callable(harness) else harness
    scan = None if wired is None else plan_scan(names, integers, wired, bits, samples.codes)
    files = _files(integers, trained, scan)
    comparison = compare(trained.stumps, integers, bits, samples.codes)
    tested = cross_validated(samples, options, steps.fold_done, ports) if folds else None
    described = manifest_to_bytes(describe(grasp_set, options, samples, trained, integers, comparison, tested, files))
    manifest = manifest_from_bytes(described)
    firmware, note = made_firmware(manifest, integers)
    made = Made(
        grasp_set=grasp_set,
        manifest=manifest,
        trained=trained,
        tables=integers,
        tables_bytes=len(files[TABLES_NAME]),
        comparison=comparison,
        confusion=None if tested is None else tested.confusion,
        harness=wired,
        scan=scan,
        firmware=note,
        only_answer=_only_answer(comparison, samples),
    )
    written = {path: text.encode() for path, text in firmware.items()}
    publish({**files, **written, **documents(made), MANIFEST_NAME: described}, target)
    return BuildReport(target, manifest, made.tables_bytes, made.only_answer, note, scan, wired)


def _check(options: Options) -> None:
    if options.table_bits not in get_args(TableBits):
        raise CompileError(f"tables of {options.table_bits} bits: firmware has entries of 8 or 16")
    if not 4 <= options.width <= 16:
        raise CompileError(f"sums of {options.width} bits: tables have 4 to 16")
    check_placement(options)


def _files(integers: IntegerTables, trained: Trained, scan: ScanMap | None) -> dict[str, bytes]:
    """Return name -> content of what `build.json` holds digests of."""
    files = {TABLES_NAME: tables_to_bytes(integers), ENSEMBLE_NAME: ensemble_to_bytes(trained.stumps)}
    return files if scan is None else {**files, SCAN_NAME: scanmap_to_bytes(scan)}


def _only_answer(comparison: Comparison, samples: Samples) -> str | None:
    answers = np.unique(comparison.deployed)
    return samples.grasps[answers[0]] if len(answers) == 1 else None


class _Steps:
    """Work done, counted in boosting rounds: one training on all rows, one for each fold."""

    def __init__(self, report: Callable[[int, int], None] | None, rounds: int, folds: int) -> None:
        self._report, self._rounds, self._folds = report, rounds, folds

    def round_done(self, done: int, _rounds: int) -> None:
        if self._report is not None:
            self._report(done, self._rounds * (1 + self._folds))

    def fold_done(self, done: int, _folds: int) -> None:
        self.round_done(self._rounds * (1 + done), self._rounds)
