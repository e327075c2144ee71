"""`compile_build`: turn recordings into a build folder."""

import hashlib
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, TABLES_NAME
from thenar.runtime.hand import HAND_NAME, hand_from_bytes, hand_to_bytes
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.live.system import unread_joints
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Origin, Proof, Switch, Threshold, Wearing
from thenar.runtime.manifest_file import manifest_from_bytes, manifest_to_bytes
from thenar.runtime.model.integers import IntegerTables, tables_to_bytes
from thenar.runtime.recipe import AUTO, PAPERS_TRAINER, Recipe, TableBits, changed
from thenar.runtime.scanning.plan import plan_scan

from ..firmware.classifier import FIRMWARE_NAME, LIBRARY_FILES
from ..glove.files import NAMES, users_files
from ..hand import HandShape, drawn_hand
from ..model.collapse import collapse
from ..model.compare import Comparison, compare
from ..model.faults import count_faults, groups_of, worst_faults
from ..placement.constraints import Limits
from ..placement.elements import Element, names_of
from ..placement.methods.base import check_placement
from ..placement.ports import PortCosts, ports_of_whole_glove
from ..publication import check_folder, publish_folder, sweep
from ..recogniser import Recogniser, predicted_classes
from ..recordings.graspset import GraspSet, Joint
from ..samples import Samples
from ..scan_file import SCAN_NAME, scanmap_to_bytes
from ..trainers.base import SHARED, Report, Training
from ..wearer import STRENGTH
from ..wearer_study import related_joints
from . import CompileError
from .documents import REPORT_NAME, SPEC_FOLDER, BuildReport, Documents
from .ensemble import ensemble_to_bytes
from .training import (
    Tested,
    cuts_of,
    detection_of,
    fold_results,
    groups_for,
    rates_of,
    samples_of,
    segments_for,
    stored_digests,
)
from .verify_firmware import made_firmware

# Without a harness a build has no scan map; a build too large for every microcontroller has no firmware; one without a
# report has no spec.
MEMBERS = frozenset({MANIFEST_NAME, TABLES_NAME, ENSEMBLE_NAME, SCAN_NAME, HAND_NAME, REPORT_NAME})
_FOLDERS = {FIRMWARE_NAME: frozenset(LIBRARY_FILES), SPEC_FOLDER: NAMES}


def check_target(folder: Path) -> Path:
    """Return `folder` resolved, if a build may be written there: a new or empty folder, or one that holds only a build.

    Deletes the leftovers of interrupted publications next to the folder, and next to its spec. Raises CompileError
    where no build may be written: files that thenar did not make are never deleted.
    """
    spec = folder.resolve() / SPEC_FOLDER
    if spec.parent.is_dir():
        sweep(spec, users_files)
    return check_folder(folder, _refuse_foreign, CompileError)[0]


def publish(files: Mapping[str, bytes], target: Path) -> None:
    """Write `files` (path below the folder -> content) as `target`, replacing what `check_target` allows there.

    If interrupted, either the old build or the new one is left, complete. Raises CompileError as `check_target` does.
    """
    # Check again: training takes a while, and the folder is the user's.
    publish_folder(files, check_target(target), _refuse_foreign, CompileError)


def _refuse_foreign(folder: Path) -> tuple[str, ...]:
    """Return nothing: no file in a build belongs to the user. Raises CompileError if one is found."""
    if any(folder.iterdir()) and not (folder / MANIFEST_NAME).exists():
        raise CompileError(f"{folder} is not empty and not a build: name another folder, or empty this one")
    places = {folder / name: names for name, names in _FOLDERS.items()}
    inner = {place: names for place, names in places.items() if place.is_dir() and not place.is_symlink()}
    foreign = [path for path in _foreign(folder, MEMBERS) if path not in inner]
    foreign += [path for place, names in inner.items() for path in _foreign(place, names)]
    if foreign:
        name = foreign[0].relative_to(folder)
        raise CompileError(f"{folder} holds {name}, which is not part of a build: move it, or name another folder")
    return ()


def _foreign(folder: Path, members: frozenset[str]) -> list[Path]:
    """Return the entries of `folder` that are not files with a member's name."""
    return [path for path in sorted(folder.iterdir()) if path.name not in members or not path.is_file()]


_MOST_REFUSED = 0.5

# A wiring, or a function that returns one for the names of the kept switches.
Wired = Harness | Callable[[Sequence[str]], Harness]


def compile_build(
    grasp_set: GraspSet,
    folder: str | Path,
    options: Recipe | None = None,
    *,
    harness: Wired | None = None,
    ports: PortCosts | None = None,
    hand: HandShape | None = None,
    prices: Mapping[str, float] | None = None,
    documents: Documents | None = None,
    jobs: int = -1,
    progress: Report | None = None,
    **changes: Any,
) -> BuildReport:
    """Choose placement and fit, train, collapse, quantise, prove, and write `folder`, either completely or not at all.

    The same recordings, options and harness give the same bytes.

    Parameters
    ----------
    grasp_set : GraspSet
        The recordings.
    folder : path
        The folder to write: new, empty, or a build, which is replaced.
    options : Recipe, optional
        How to choose, train and quantise.
    harness : Harness or callable, optional
        A wiring, or a function that returns one for the names of the kept switches. It makes the build state how to
        read its switches.
    ports : PortCosts, optional
        The cost of reading each switch, for methods that use it. None: a glove with as few MCP23017 as possible.
    hand : HandShape, optional
        Switch positions, for `hand.json` and `apart_mm`. None: the hand of the documents.
    prices : mapping, optional
        The price of each sensor, by name, for `price`, and to prefer the cheaper of two that are nearly as good.
    documents : Documents, optional
        A report and the spec of the glove, to write into the folder.
    jobs : int
        Worker processes for the folds; -1: all cores. The build does not depend on their number.
    progress : callable, optional
        Called with (done, total) as the work proceeds.
    **changes
        Single options, such as `prune=13` or `rounds=50`, which override those in `options`, and settings of the
        trainer.

    Returns
    -------
    BuildReport
        Where the build is, and its properties.

    Raises
    ------
    CompileError
        If the recordings, the options or the folder do not allow a build.
    HarnessError, SettingError
        If the harness lacks a kept switch, or one of the joints while it measures others.

    Notes
    -----
    A placement method or a trainer may raise another ThenarError about its options.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, compile_build
    >>> report = compile_build(GraspSet.load("set.grasps"), "build", rounds=10, folds=0)
    >>> report.manifest.options.rounds
    10
    """
    target = check_target(Path(folder))
    recipe = _sound(changed(options or Recipe(), changes))
    samples = samples_of(grasp_set, recipe)
    folds, steps = sum(len(cut.folds) for cut in cuts_of(grasp_set, recipe)), 1

    # Work is counted in steps of training: as many for each fold as for all rows.
    def trained(done: int, total: int) -> None:
        nonlocal steps
        steps = total
        if progress is not None:
            progress(done, steps * (1 + folds))

    def tested(done: int, _folds: int) -> None:
        trained(steps * (1 + done), steps)

    ports = ports or ports_of_whole_glove(None, grasp_set.element_names, len(grasp_set.taxel_columns))
    hand = hand or (None if documents is None else documents.hand)
    glove = harness.cyberglove if isinstance(harness, Harness) else None
    limits = Limits.of(recipe, grasp_set, {} if hand is None else hand.by_name, glove, prices)
    groups = groups_for(grasp_set, recipe)
    recogniser = Recogniser.fit(samples, recipe, ports=ports, limits=limits, groups=groups, jobs=jobs, report=trained)
    made = BuildAssembly(grasp_set, recogniser, harness, hand)
    results = fold_results(grasp_set, samples, recipe, ports=ports, limits=limits, jobs=jobs, report=tested)
    return made.publish(target, results, documents)


def _sound(options: Recipe) -> Recipe:
    """Return the options in canonical form, however they were given. Raises CompileError for invalid ones."""
    if options.table_bits not in get_args(TableBits):
        raise CompileError(f"table_bits={options.table_bits}: firmware tables have entries of 8 or 16 bits")
    if not 4 <= options.width <= 16:
        raise CompileError(f"width={options.width}: the sums of tables have 4 to 16 bits")
    if not 0 <= options.refuse < _MOST_REFUSED:
        raise CompileError(f"refuse={options.refuse}: give a share of grasps of at least 0 and below {_MOST_REFUSED}")
    check_placement(options)
    only, *others = Training.candidates(options)
    trainer, settings = options.trainer, {name: getattr(options, name) for name in SHARED} | options.settings
    if not others:
        # Nothing is left to choose. Recipe with rounds mean LogitBoost.
        trainer, settings = AUTO if only.trainer == PAPERS_TRAINER else only.trainer, dict(only.settings)
    values = {name: float(value) if isinstance(value, int) else value for name, value in settings.items()}
    unusual: dict[str, Any] = {name: value for name, value in values.items() if value is not None}
    shared = {name: unusual.pop(name, None) for name in SHARED}
    shared |= {name: int(shared[name]) for name in ("rounds", "max_bins") if shared[name] is not None}
    # msgspec omits a value that equals its default only if it is the same object.
    names = {"placement": sys.intern(options.placement), "trainer": sys.intern(trainer)}
    usual_share = Recipe().refuse
    refuse = usual_share if options.refuse == usual_share else float(options.refuse)
    return replace(options, **shared, **names, settings=unusual, refuse=refuse)


class BuildAssembly:
    """A build before it is written: a recogniser, the comparison of its model with its integer tables, and how to read
    the switches.
    """

    def __init__(
        self, grasp_set: GraspSet, recogniser: Recogniser, harness: Wired | None, hand: HandShape | None = None
    ) -> None:
        self.grasp_set, self.recogniser, self.hand = grasp_set, recogniser, hand
        self.kept, self.integers = recogniser.read(recogniser.samples), recogniser.tables
        names = names_of(grasp_set, recogniser.elements)
        self.harness = harness(names) if callable(harness) else harness
        self.scan, self.unread = None, ""
        if self.harness is not None:
            self.scan = plan_scan(names, self.harness)
            joints = [grasp_set.joint_names[joint] for joint in recogniser.selection.joints]
            self.unread = unread_joints(self.harness, names, self.scan, joints)
        self.comparison = compare(recogniser.model, self.integers, self.kept.switches, self.kept.codes)
        self._inputs = (*names, *(grasp_set.joint_names[joint] for joint in recogniser.selection.joints))
        sources = [grasp_set.element_names[element.column] for element in recogniser.elements]
        self._groups = groups_of(self.scan, sources, len(recogniser.selection.joints))
        groups = tuple(self._groups.values())
        grasps = self.kept.without_none()
        self.faults = count_faults(self.integers, grasps.switches, grasps.codes, grasps.labels, grasps.trials, groups)

    def publish(self, target: Path, tested: Tested | None, documents: Documents | None) -> BuildReport:
        """Write the build as `target`, with the requested `documents`."""
        kept, names, n_switches = self.kept, self.grasp_set.element_names, len(self.grasp_set.switch_names)
        files = {TABLES_NAME: tables_to_bytes(self.integers), ENSEMBLE_NAME: ensemble_to_bytes(self.recogniser.model)}
        if self.scan is not None:
            files[SCAN_NAME] = scanmap_to_bytes(self.scan)
        undrawn = self._manifest(tested, files)
        drawing = drawn_hand(undrawn, self.hand, names[:n_switches], names[n_switches:], kept.codes)
        files[HAND_NAME] = hand_to_bytes(drawing)
        described = manifest_to_bytes(replace(undrawn, hand_sha256=sha256(files[HAND_NAME])))
        manifest = manifest_from_bytes(described)
        firmware, note = made_firmware(manifest, self.integers)
        predicted = np.unique(self.comparison.deployed)
        report = BuildReport(
            folder=target,
            manifest=manifest,
            tables=self.integers,
            tables_bytes=len(files[TABLES_NAME]),
            only_answer=kept.grasps[predicted[0]] if len(predicted) == 1 else None,
            firmware=note,
            scan=self.scan,
            harness=self.harness,
            grasp_set=self.grasp_set,
            recogniser=self.recogniser,
            comparison=self.comparison,
            faults=self.faults,
            drawing=hand_from_bytes(files[HAND_NAME], manifest),
            unread=self.unread,
            confusion=None if tested is None else tested.confusion,
        )
        files |= {path: text.encode() for path, text in firmware.items()}
        if documents is not None:
            files |= documents.files(report)
        publish(files | {MANIFEST_NAME: described}, target)
        return report

    def _manifest(self, tested: Tested | None, files: Mapping[str, bytes]) -> Manifest:
        """Return the content of `build.json`, not sealed yet; `files` maps the names of its neighbours to content."""
        digests = {name: sha256(data) for name, data in files.items()}
        grasp_set, recogniser = self.grasp_set, self.recogniser
        options, samples, fitting = recogniser.recipe, recogniser.samples, recogniser.fitting
        kept, comparison = self.kept, self.comparison
        deployed = predicted_classes(self.integers, recogniser.rejection, kept.switches, kept.codes)
        rates = rates_of("training", samples, deployed, options.seed)
        detection = detection_of("training", samples, deployed, options.seed)
        elements = recogniser.elements
        switches = zip(elements, names_of(grasp_set, elements), recogniser.selection.gains, strict=True)
        shares = kept.switches.mean(axis=0).tolist()
        related = related_joints(collapse(recogniser.model, kept.n_switches), kept)
        strength = STRENGTH if tested is None else tested.strength
        return Manifest(
            schema=SCHEMA,
            checksum="",
            thenar=version("thenar"),
            tables_sha256=digests[TABLES_NAME],
            ensemble_sha256=digests[ENSEMBLE_NAME],
            source=origin_of(grasp_set),
            options=options,
            grasps=samples.grasps,
            switches=tuple(
                replace(
                    self._switch(*each),
                    closed_least=least.tobytes().hex(),
                    closed_most=most.tobytes().hex(),
                    closed_share=share,
                )
                for each, least, most, share in zip(switches, *closed_shares(kept), shares, strict=True)
            ),
            joints=tuple(_calibration(column, grasp_set.joints[column]) for column in recogniser.selection.joints),
            proof=proof_of(self.integers, comparison, options.width),
            rates=rates if tested is None else (*rates, *tested.rates),
            stopped_after=recogniser.stopped_after,
            zero_gain_nodes=recogniser.zero_gain_nodes,
            scan_sha256=digests.get(SCAN_NAME),
            fitting=fitting if fitting is not None and fitting.compared else None,
            faults=worst_faults(self.faults, self._inputs, self._groups),
            detection=detection if tested is None else (*detection, *tested.detection),
            rejection=recogniser.rejection,
            segments=segments_for(grasp_set, samples, None if tested is None else tested.scores, self.integers.scale),
            wearing=Wearing(strength, related) if related or strength != STRENGTH else None,
        )

    def _switch(self, element: Element, name: str, gain: float) -> Switch:
        (column, code), taxel = element, element.column - len(self.grasp_set.switch_names)
        if taxel < 0:
            return Switch(column, name, gain)
        joint = self.grasp_set.taxel_columns[taxel]
        return Switch(column, name, gain, Threshold(code, float(joint.value(code + 0.5)), _calibration(taxel, joint)))


def origin_of(grasp_set: GraspSet) -> Origin:
    """Return the description of recordings."""
    return Origin(
        fingerprint=grasp_set.fingerprint(),
        rows=len(grasp_set),
        taxonomy=grasp_set.taxonomy.name,
        switches=len(grasp_set.switch_names),
        simulated=grasp_set.simulated,
        independent=grasp_set.independent,
        taxels=len(grasp_set.taxel_columns),
        joints=len(grasp_set.joints),
        trials=stored_digests(grasp_set),
    )


def proof_of(integers: IntegerTables, comparison: Comparison, width: int) -> Proof:
    """Return the bounds of integer tables of `width` bits that were compared with their model."""
    return Proof(
        width=width,
        scale=integers.scale,
        bound=integers.bound,
        error=comparison.integer_bound,
        safe_margin=comparison.safe_margin,
        covered=int(np.count_nonzero(comparison.covered)),
        changed=len(comparison.changed),
    )


def sha256(data: bytes) -> str:
    """Return the digest of a file."""
    return hashlib.sha256(data).hexdigest()


def closed_shares(samples: Samples) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the extreme shares of trials in which each switch is closed, by grasp type, in 255ths: two arrays (s, K).

    The first array holds the smallest share of any subject, rounded down; the second the largest, rounded up. A trial
    counts as closed where most of its frames are. c of n trials are a share of (c + 1/2) / (n + 1).
    """
    shape = samples.n_switches, samples.n_classes
    least, most = np.full(shape, 255, np.uint8), np.zeros(shape, np.uint8)
    _, first, trial = np.unique(samples.trials, return_index=True, return_inverse=True)
    frames, closed = np.bincount(trial), np.zeros((len(first), samples.n_switches), np.intp)
    np.add.at(closed, trial, samples.switches)
    of_trial = samples.subjects[first] * samples.n_classes + samples.labels[first]
    for group in np.unique(of_trial):
        who, label = np.flatnonzero(of_trial == group), group % samples.n_classes
        count = np.count_nonzero(2 * closed[who] >= frames[who, np.newaxis], axis=0)
        parts, whole = 255 * (2 * count + 1), 2 * len(who) + 2
        least[:, label] = np.minimum(least[:, label], parts // whole)
        most[:, label] = np.maximum(most[:, label], -(-parts // whole))
    return least, most


def _calibration(column: int, joint: Joint) -> Calibration:
    return Calibration(column, joint.name, joint.unit, joint.code_a, joint.value_a, joint.code_b, joint.value_b)
