"""`adapt`: a build of the same elements and form for one person, from a build and a few of the person's own trials."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from thenar.runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, SCAN_NAME, TABLES_NAME, Build, read_member
from thenar.runtime.hand import HAND_NAME
from thenar.runtime.manifest import Adapted, Manifest, Of, Recognised, Rejection, Wearing
from thenar.runtime.manifest_file import manifest_from_bytes, manifest_to_bytes
from thenar.runtime.model.integers import LIMIT, MAX_BYTES, IntegerTables, tables_to_bytes
from thenar.runtime.model.tables import winners
from thenar.runtime.names import list_names, nearest
from thenar.runtime.segmenting.model import STEPS, SegmentModel, gain_of

from ..model.collapse import collapse
from ..model.compare import compare
from ..model.quantise import quantise
from ..recogniser import predicted_classes
from ..recordings.graspset import GraspSet
from ..samples import decided, select_inputs
from ..wearer import STRENGTH, Adaptation, AdaptationError
from .compile import check_target, origin_of, proof_of, publish, sha256
from .documents import SPEC_FOLDER
from .ensemble import ensemble_to_bytes
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
        The content of `build.json`.
    before, after : int
        The person's trials that the other build recognises, and those that it recognises adapted to all others.
    warnings : tuple of str
        Sentences on trials that contradict each other, and on types without trials.
    firmware : str
        What the firmware is laid out for, or why there is none, in words; empty where a package to write it is missing.
    """

    folder: Path
    manifest: Manifest
    before: int
    after: int
    warnings: tuple[str, ...]
    firmware: str


def adapt(folder: str | Path, recordings: GraspSet, output: str | Path) -> AdaptedBuild:
    """Write a build for one person: the same elements, thresholds and kinds of terms, with scores for this person.

    The base dependencies suffice; without the extra `compiler` the build has no firmware. The same input gives the same
    bytes on every machine.

    Parameters
    ----------
    folder : path
        The build of everybody.
    recordings : GraspSet
        The person's trials. Types may be missing.
    output : path
        The folder to write: new, empty, or a build, which is replaced.

    Returns
    -------
    AdaptedBuild
        Where it is, and its properties.

    Raises
    ------
    AdaptationError
        If there are no trials, or of a type that the build does not know.
    CompileError
        If the recordings lack inputs of the build, or `output` is not a folder for one.
    BuildError, FormatError
        If there is no build.

    Examples
    --------
    >>> import numpy as np
    >>> from thenar.compiler import GraspSet, adapt, compile_build
    >>> grasp_set = GraspSet.load("set.grasps")
    >>> report = compile_build(grasp_set, "build", rounds=5, folds=0)
    >>> sum(adapt("build", grasp_set.rows(np.arange(6)), "mine").manifest.adapted.counts)
    6
    """
    target, source = check_target(Path(output)), Path(folder)
    crowd = Build.load(source)
    manifest, old, wearing = crowd.manifest, crowd.tables, crowd.manifest.wearing or Wearing(STRENGTH)
    if target == source.resolve() or manifest.adapted is not None:
        raise AdaptationError(f"{source} must be the build of everybody, and the folder to write another one")
    if not manifest.knows_none:
        recordings = recordings.without_none()
    grasps = np.array(manifest.grasps)
    if unknown := sorted({*recordings.grasps.tolist()} - {*manifest.grasps}):
        raise AdaptationError(
            f"the build does not know {list_names(unknown)}{nearest(unknown[0], manifest.grasps)}: leave these trials "
            "out, or compile a build with trials of others"
        )
    bits, codes = select_inputs(recordings, manifest)
    labels = (recordings.grasps[:, np.newaxis] == grasps).argmax(axis=1)
    before = collapse(load_ensemble(source, crowd), old.n_switches)
    trials = recordings.trial_ids
    adaptation = Adaptation(before, bits, codes, labels, trials, wearing.strength, wearing.related)
    made = quantise(adaptation.adapted, bits, codes, manifest.options.width, manifest.options.table_bits)
    tables = _with_substitutes(made, old, bits, codes)
    rejection = _wider(manifest.rejection, old, tables, bits, codes, labels)
    guesses = [labels, winners(before.scores(bits, codes)), winners(adaptation.left_out)]
    guesses.append(predicted_classes(tables, rejection, bits, codes))
    truth, *rows = decided(np.stack(guesses), np.unique(trials, return_inverse=True)[1])
    unadapted, left_out, learnt = (int(np.count_nonzero(row == truth)) for row in rows)
    counts, seed = np.bincount(truth, minlength=len(grasps)).tolist(), manifest.options.seed
    of: Of = "within subject"
    files = {TABLES_NAME: tables_to_bytes(tables), ENSEMBLE_NAME: ensemble_to_bytes(adaptation.adapted)}
    described = manifest_to_bytes(
        structs.replace(
            manifest,
            thenar=version("thenar"),
            tables_sha256=sha256(files[TABLES_NAME]),
            ensemble_sha256=sha256(files[ENSEMBLE_NAME]),
            proof=proof_of(tables, compare(adaptation.adapted, tables, bits, codes), manifest.options.width),
            rates=(
                Recognised("training", 0, seed, learnt, len(truth), of, "trials"),
                Recognised("nested", len(truth), seed, left_out, len(truth), of, "trials"),
            ),
            faults=None,
            detection=(),
            rejection=rejection,
            segments=_rescaled(manifest.segments, old.scale / tables.scale),
            adapted=Adapted(manifest.checksum, origin_of(recordings), tuple(counts)),
        )
    )
    personal = manifest_from_bytes(described)
    try:
        firmware, note = made_firmware(personal, tables)
    except ModuleNotFoundError:
        firmware, note = {}, ""
    files |= {path: text.encode() for path, text in firmware.items()} | _carried(source, manifest)
    publish(files | {MANIFEST_NAME: described}, target)
    return AdaptedBuild(target, personal, unadapted, left_out, tuple(_warnings(manifest, adaptation, counts)), note)


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
        yield f"no trials of {list_names(missing)}: they change as the other types do on average"
