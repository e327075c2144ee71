"""`adapt`: a build of the same elements and form for one person, from a build and a few of the person's own trials."""

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from msgspec import structs
from numpy.typing import ArrayLike, NDArray

from thenar.runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, SCAN_NAME, TABLES_NAME, Build, read_member
from thenar.runtime.hand import HAND_NAME
from thenar.runtime.manifest import Adapted, Manifest, Proof, Recognised, Rejection
from thenar.runtime.manifest_file import manifest_from_bytes, manifest_to_bytes
from thenar.runtime.model.integers import LIMIT, MAX_BYTES, IntegerTables, tables_to_bytes
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.tables import ScoreTables, winners
from thenar.runtime.model.terms.base import HIGHEST_CODE
from thenar.runtime.names import list_names, nearest
from thenar.runtime.segmenting.model import STEPS, SegmentModel, gain_of

from ..model.collapse import collapse
from ..model.compare import compare
from ..recogniser import predicted_classes
from ..recordings.graspset import GraspSet
from ..samples import decided
from ..wearer import STRENGTH, Adaptation, AdaptationError
from .compile import check_target, publish
from .documents import SPEC_FOLDER
from .ensemble import ensemble_to_bytes
from .training import stored_digests
from .verify import load_ensemble
from .verify_firmware import made_firmware


@dataclass(frozen=True, slots=True, eq=False)
class AdaptedBuild:
    """A build that was adapted to one person.

    Attributes
    ----------
    folder : Path
        Its folder.
    manifest : Manifest
        The content of `build.json`; `adapted` counts the trials, and those recognised before and after.
    model, tables : ScoreTables and IntegerTables
        The scores, and the integers made of them.
    warnings : tuple of str
        Sentences on trials that contradict each other, and on types without trials.
    firmware : str
        What the firmware is laid out for, or why there is none, in words; empty where a package to write it is missing.
    """

    folder: Path
    manifest: Manifest
    model: ScoreTables
    tables: IntegerTables
    warnings: tuple[str, ...]
    firmware: str


def adapt(
    build: str | Path,
    X: ArrayLike,
    y: ArrayLike,
    output: str | Path,
    *,
    trials: ArrayLike | None = None,
    strength: float | None = None,
    recordings: GraspSet | None = None,
) -> AdaptedBuild:
    """Write a build for one person: the same elements, thresholds and kinds of terms, with scores for this person.

    The base dependencies suffice; without the extra `compiler` the build has no firmware. The same input gives the same
    bytes on every machine.

    Parameters
    ----------
    build : path
        The build of everybody.
    X : array of int, shape (n, s + j)
        The person's frames: the build's switches, 0 or 1, then the codes of its joints, in the build's order.
    y : array of str, shape (n,)
        The grasp type of each frame. Types may be missing.
    output : path
        The folder to write: new, empty, or a build, which is replaced.
    trials : array of int, shape (n,), optional
        The trial of each frame. None: each is one.
    strength : float, optional
        The pull towards the build. None: the one that it stores, or 1.
    recordings : GraspSet, optional
        Where the frames are from, so that `verify` knows trials that were adapted to.

    Returns
    -------
    AdaptedBuild
        Where it is, and its properties.

    Raises
    ------
    AdaptationError
        If there are no trials, or of a type that the build does not know.
    BuildError, FormatError, CompileError
        If there is no build, or `output` is not a folder for one.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, Samples, adapt, compile_build
    >>> others = GraspSet.load("set.grasps")
    >>> report = compile_build(others, "build", rounds=5, folds=0, prune=0, inputs="joints")
    >>> mine = adapt("build", others.codes[:6], others.grasps[:6], "mine")
    >>> mine.manifest.adapted.total
    6
    """
    target, folder = check_target(Path(output)), Path(build)
    if target == folder.resolve():
        raise AdaptationError(f"{folder} is the build to adapt: name another folder to write")
    crowd = Build.load(folder)
    manifest, old = crowd.manifest, crowd.tables
    if manifest.adapted is not None:
        raise AdaptationError(f"{folder} is adapted to a person already: adapt the build that it was made of")
    bits, codes, labels = _frames(manifest, X, y)
    trial = np.arange(len(labels)) if trials is None else np.unique(np.asarray(trials), return_inverse=True)[1]
    wearing = manifest.wearing
    if strength is None:
        strength = STRENGTH if wearing is None else wearing.strength
    before = collapse(load_ensemble(folder, crowd), old.n_switches)
    adaptation = Adaptation(before, bits, codes, labels, trial, strength, () if wearing is None else wearing.related)
    model = adaptation.adapted
    made = quantise(model, bits, codes, manifest.options.width, manifest.options.table_bits)
    tables = _with_substitutes(made, old, bits, codes)
    rejection = _wider(manifest.rejection, old, tables, bits, codes, labels)
    comparison = compare(model, tables, bits, codes)
    guesses = [labels, winners(before.scores(bits, codes)), winners(adaptation.left_out)]
    truth, *rows = decided(np.stack([*guesses, predicted_classes(tables, rejection, bits, codes)]), trial)
    unadapted, left_out, learnt = (int(np.count_nonzero(row == truth)) for row in rows)
    counts = tuple(np.bincount(truth, minlength=len(manifest.grasps)).tolist())
    files = {TABLES_NAME: tables_to_bytes(tables), ENSEMBLE_NAME: ensemble_to_bytes(model)}
    seed = manifest.options.seed
    described = manifest_to_bytes(
        structs.replace(
            manifest,
            thenar=version("thenar"),
            tables_sha256=_sha256(files[TABLES_NAME]),
            ensemble_sha256=_sha256(files[ENSEMBLE_NAME]),
            proof=Proof(
                width=manifest.options.width,
                scale=tables.scale,
                bound=tables.bound,
                error=comparison.integer_bound,
                safe_margin=comparison.safe_margin,
                covered=int(np.count_nonzero(comparison.covered)),
                changed=len(comparison.changed),
            ),
            rates=(
                Recognised("training", 0, seed, learnt, len(truth), "within subject", "trials"),
                Recognised("nested", len(truth), seed, left_out, len(truth), "within subject", "trials"),
            ),
            faults=None,
            detection=(),
            rejection=rejection,
            segments=_rescaled(manifest.segments, old.scale / tables.scale),
            adapted=Adapted(
                build=manifest.checksum,
                fingerprint=_fingerprint(bits, codes, labels) if recordings is None else recordings.fingerprint(),
                rows=len(labels),
                digests="" if recordings is None else stored_digests(recordings),
                counts=counts,
                strength=strength,
                before=unadapted,
                after=left_out,
            ),
        )
    )
    personal = manifest_from_bytes(described)
    try:
        firmware, note = made_firmware(personal, tables)
    except ModuleNotFoundError:
        firmware, note = {}, ""
    files |= {path: text.encode() for path, text in firmware.items()} | _carried(folder, manifest)
    publish(files | {MANIFEST_NAME: described}, target)
    return AdaptedBuild(target, personal, model, tables, tuple(_warnings(manifest, adaptation, counts)), note)


def _frames(
    manifest: Manifest, X: ArrayLike, y: ArrayLike
) -> tuple[NDArray[np.bool_], NDArray[np.uint16], NDArray[np.intp]]:
    """Return the frames' switches, codes and classes. Raises AdaptationError."""
    frames, names, s, grasps = np.asarray(X), np.asarray(y), len(manifest.switches), list(manifest.grasps)
    width = s + len(manifest.joints)
    if not names.size:
        raise AdaptationError("there are no trials to adapt to: record some of each type")
    if frames.shape != (names.size, width) or names.ndim != 1:
        raise AdaptationError(f"frames {frames.shape} of types {names.shape} must be (n, {width}) and (n,)")
    if unknown := sorted({*names.tolist()} - {*grasps}):
        raise AdaptationError(
            f"the build does not know {list_names(unknown)}{nearest(str(unknown[0]), grasps)}: leave these trials out, "
            "or compile a build with trials of others"
        )
    if frames.min() < 0 or frames.max() > HIGHEST_CODE:
        raise AdaptationError(f"frames hold {frames.min()} to {frames.max()}: codes are 0 to {HIGHEST_CODE}")
    labels = np.array([grasps.index(name) for name in names.tolist()], np.intp)
    return frames[:, :s].astype(np.bool_), frames[:, s:].astype(np.uint16), labels


def _with_substitutes(
    made: IntegerTables, old: IntegerTables, bits: NDArray[np.bool_], codes: NDArray[np.uint16]
) -> IntegerTables:
    """Return tables whose substitutes of lost inputs differ from the mean contributions in the person's frames, which
    they are in `made`, as much as they did before.
    """
    switch_means, joint_means = made.switch_means.astype(np.float64), made.joint_means.astype(np.float64)
    ratio, rows = made.scale / old.scale, made.switch_rows
    share = bits.sum(axis=0)[:, np.newaxis] / len(bits)
    switch_means += (old.switch_means - share * old.switch_rows) * ratio
    for joint, column in enumerate(codes.T):
        contribution = sum(term.of(column).astype(np.int64).sum(axis=0) for term in old.of_joint(joint))
        possible = made.choices(joint)[1]
        joint_means[joint] += (old.joint_means[joint] - contribution / len(codes)) * ratio
        joint_means[joint] = np.clip(joint_means[joint], possible.min(axis=0), possible.max(axis=0))
    switch_means = np.clip(switch_means, np.minimum(rows, 0), np.maximum(rows, 0))
    return replace(
        made,
        switch_means=np.rint(switch_means).astype(np.int16),
        joint_means=np.rint(joint_means).astype(np.int16),
    )


def _wider(
    rejection: Rejection | None,
    old: IntegerTables,
    tables: IntegerTables,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    labels: NDArray[np.intp],
) -> Rejection | None:
    """Return the limits in steps of the new tables, widened so that each contains the person's frames of its type."""
    if rejection is None:
        return None
    scores, count = tables.scores(bits, codes), bits.sum(axis=1)
    least = [math.floor(score * tables.scale / old.scale) for score in rejection.least_scores]
    closed, ranges = list(rejection.closed), list(rejection.ranges)
    for label in np.unique(labels).tolist():
        rows = labels == label
        least[label] = min(least[label], int(scores[rows, label].min()))
        fewest, most = closed[label]
        closed[label] = min(fewest, int(count[rows].min())), max(most, int(count[rows].max()))
        ends = zip(ranges[label], codes[rows].min(axis=0).tolist(), codes[rows].max(axis=0).tolist(), strict=True)
        ranges[label] = tuple((min(low, lowest), max(high, highest)) for (low, high), lowest, highest in ends)
    limits = {"least_scores": tuple(max(-LIMIT - 1, min(LIMIT, score)) for score in least)}
    return structs.replace(rejection, **limits, closed=tuple(closed), ranges=tuple(ranges))


def _rescaled(segments: SegmentModel | None, ratio: float) -> SegmentModel | None:
    """Return the costs of segments for scores of `ratio` times as many units a step."""
    if segments is None:
        return None
    shift, gain = gain_of(1.0, segments.gain * ratio / STEPS / 2.0 ** (8 + segments.shift))
    return structs.replace(segments, shift=shift, gain=gain)


def _carried(folder: Path, manifest: Manifest) -> dict[str, bytes]:
    """Return the files of the other build that stay as they are."""
    kept = {SCAN_NAME: manifest.scan_sha256, HAND_NAME: manifest.hand_sha256}
    files = {name: read_member(folder / name, MAX_BYTES, digest) for name, digest in kept.items() if digest is not None}
    spec = sorted((folder / SPEC_FOLDER).glob("*")) if (folder / SPEC_FOLDER).is_dir() else []
    return files | {f"{SPEC_FOLDER}/{path.name}": read_member(path, MAX_BYTES) for path in spec}


def _warnings(manifest: Manifest, adaptation: Adaptation, counts: Sequence[int]) -> Iterator[str]:
    for classes in adaptation.contradictions:
        names = list_names([manifest.grasps[number] for number in classes])
        yield f"a frame is the same for {names}: if one of these trials was labelled wrongly, leave it out"
    if missing := [name for name, count in zip(manifest.grasps, counts, strict=True) if not count]:
        yield f"no trials of {list_names(missing)}: changed as the other types are on average"


def _fingerprint(bits: NDArray[np.bool_], codes: NDArray[np.uint16], labels: NDArray[np.intp]) -> str:
    return _sha256(np.column_stack([bits, codes, labels]).astype("<i8").tobytes())


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
