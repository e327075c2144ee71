"""`adapt`: a build of the same elements and form for one person, from a build and a few of the person's own trials."""

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from msgspec import structs
from numpy.typing import ArrayLike, NDArray

from thenar.runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, TABLES_NAME, Build, read_member
from thenar.runtime.hand import HAND_NAME, hand_from_bytes
from thenar.runtime.manifest import Adapted, Manifest, Of, Recognised, Rejection, Switch, Wearing
from thenar.runtime.manifest_file import manifest_from_bytes, manifest_to_bytes
from thenar.runtime.model.integers import LIMIT, MAX_BYTES, IntegerTables, tables_to_bytes
from thenar.runtime.model.quantise import in_bytes, quantise
from thenar.runtime.model.tables import winners
from thenar.runtime.names import list_names, nearest, shortened
from thenar.runtime.published import NONE
from thenar.runtime.segmenting.model import STEPS, SegmentModel, gain_of

from ..evaluation.rates import Rate
from ..model.collapse import collapse
from ..model.compare import compare
from ..recogniser import predicted_classes
from ..recordings.graspset import GraspSet, Joint
from ..recordings.taxonomy import ANY, own
from ..samples import Samples, check_types, decided, select_inputs
from ..scan_file import SCAN_NAME
from ..wearer import STRENGTH, Adaptation
from . import CompileError
from .compile import check_target, closed_shares, origin_of, proof_of, publish, sha256
from .documents import REPORT_NAME, SPEC_FOLDER, stated_report
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
    by_type : tuple of (int, int, int)
        For each grasp type of the manifest: the person's trials, and which of them are counted in before and in after.
    warnings : tuple of str
        Sentences on trials that contradict each other, and on types without trials.
    firmware : str
        What the firmware is laid out for, or why there is none, in words; empty where a package to write it is missing.
    """

    folder: Path
    manifest: Manifest
    before: int
    after: int
    by_type: tuple[tuple[int, int, int], ...]
    warnings: tuple[str, ...]
    firmware: str


def adapt(
    folder: str | Path,
    X: GraspSet | ArrayLike,
    y: ArrayLike | None = None,
    *,
    output: str | Path,
    trials: ArrayLike | None = None,
    add_type: Sequence[str] = (),
) -> AdaptedBuild:
    """Write a build for one person: the same elements, thresholds and kinds of terms, with scores for this person.

    The base dependencies suffice; without the extra `compiler` the build has no firmware and no report. The same input
    gives the same bytes on every machine.

    Parameters
    ----------
    folder : path
        The build of everybody.
    X : GraspSet, or array, shape (n, s + j)
        The person's trials: recordings, or a frame in each row, first the bits of the build's switches (of a taxel:
        whether its code is above the threshold), then the codes of its joints, in the order of `build.json`.
    y : array of str, shape (n,), optional
        The grasp type of each frame of an array. Types may be missing.
    output : path
        The folder to write: new, empty, or a build, which is replaced.
    trials : array of int, shape (n,), optional
        The trial of each frame of an array. None: each is a trial.
    add_type : sequence of str
        Types that the build does not know and that these trials teach: three of each suffice, with two of each type
        that it knows.

    Returns
    -------
    AdaptedBuild
        Where it is, and its properties.

    Raises
    ------
    SettingError
        If there are no trials, or too many.
    CompileError
        If there are trials of a type that the build does not know; if a type to add is known or has no trials; if the
        recordings lack inputs of the build, or `output` is not a folder for one.
    RecordingError
        If an array holds no bits and codes.
    BuildError, FormatError
        If there is no build.

    Examples
    --------
    >>> import numpy as np
    >>> from thenar.compiler import GraspSet, adapt, compile_build
    >>> grasp_set = GraspSet.load("set.grasps")
    >>> report = compile_build(grasp_set, "build", rounds=5, folds=0)
    >>> sum(adapt("build", grasp_set.rows(np.arange(6)), output="mine").manifest.adapted.counts)
    6

    From arrays, with a type that nobody else has:

    >>> manifest = report.manifest
    >>> X = np.tile(np.arange(len(manifest.switches) + len(manifest.joints)) % 2, (5, 1))
    >>> y = ["my own"] * 3 + [manifest.grasps[0]] * 2
    >>> adapt("build", X, y, output="mine", add_type=["my own"]).manifest.adapted.added
    ('my own',)
    """
    target, source = check_target(Path(output)), Path(folder)
    crowd = Build.load(source)
    manifest, old, wearing = crowd.manifest, crowd.tables, crowd.manifest.wearing or Wearing(STRENGTH)
    if target == source.resolve() or manifest.adapted is not None:
        raise CompileError(f"{source} must be the build of everybody, and the folder to write another one")
    recordings, bits, codes = _inputs(manifest, X, y, trials)
    place = len(manifest.grasps) - manifest.knows_none
    new, names = range(place, place + len(add_type)), manifest.grasps_with(add_type)
    _check_types(manifest, recordings, add_type)
    labels = (recordings.grasps[:, np.newaxis] == np.array(names)).argmax(axis=1)
    before = collapse(load_ensemble(source, crowd), old.n_switches)
    trial = recordings.trial_ids
    adaptation = Adaptation(before, bits, codes, labels, trial, wearing.strength, wearing.related, new)
    made = quantise(adaptation.adapted, bits, codes, manifest.options.width, manifest.options.table_bits)
    tables = _with_substitutes(made, old, bits, codes, adaptation)
    rejection = _wider(manifest.rejection, old, tables, bits, codes, labels, new)
    known = np.delete(np.arange(len(names)), new)
    guesses = [labels, known[winners(before.scores(bits, codes))], winners(adaptation.left_out)]
    guesses.append(predicted_classes(tables, rejection, bits, codes))
    truth, *rows = decided(np.stack(guesses), np.unique(trial, return_inverse=True)[1])
    right = [np.bincount(truth[row == truth], minlength=len(names)).tolist() for row in rows]
    unadapted, left_out, learnt = map(sum, right)
    counts, seed = np.bincount(truth, minlength=len(names)).tolist(), manifest.options.seed
    of: Of = "within subject"
    ends = Rate.counted((left_out,), len(truth), of=of)
    files = {TABLES_NAME: tables_to_bytes(tables), ENSEMBLE_NAME: ensemble_to_bytes(adaptation.adapted)}
    described = manifest_to_bytes(
        structs.replace(
            manifest,
            thenar=version("thenar"),
            tables_sha256=sha256(files[TABLES_NAME]),
            ensemble_sha256=sha256(files[ENSEMBLE_NAME]),
            grasps=names,
            switches=_closed(manifest.switches, Samples(bits, codes, labels, names, trial), new),
            proof=proof_of(tables, compare(adaptation.adapted, tables, bits, codes), manifest.options.width),
            rates=(
                Recognised("training", 0, seed, learnt, len(truth), of, "trials"),
                Recognised("nested", len(truth), seed, left_out, len(truth), of, "trials", ends.low, ends.high),
            ),
            faults=None,
            detection=(),
            rejection=rejection,
            segments=_rescaled(manifest.segments, old.scale / tables.scale, new),
            adapted=Adapted(manifest.checksum, origin_of(recordings), tuple(counts), tuple(add_type)),
        )
    )
    personal = manifest_from_bytes(described)
    files |= _carried(source, manifest)
    note = ""
    with suppress(ModuleNotFoundError):
        firmware, note = made_firmware(personal, tables)
        files |= {path: text.encode() for path, text in firmware.items()}
        hand = hand_from_bytes(files[HAND_NAME], personal)
        confusion = np.zeros((len(names), len(names)), np.intp)
        np.add.at(confusion, (labels, guesses[2]), 1)
        build = Build(personal, tables)
        files[REPORT_NAME] = stated_report(build, hand, bits, codes, labels, note, confusion)
    publish(files | {MANIFEST_NAME: described}, target)
    warnings = tuple(_warnings(personal, adaptation, recordings))
    by_type = tuple(zip(counts, *right[:2], strict=True))
    return AdaptedBuild(target, personal, unadapted, left_out, by_type, warnings, note)


def _inputs(
    manifest: Manifest, X: GraspSet | ArrayLike, y: ArrayLike | None, trials: ArrayLike | None
) -> tuple[GraspSet, NDArray[np.bool_], NDArray[np.uint16]]:
    """Return the trials as recordings, without those of nothing held where the build does not know it, and as the
    build's inputs (n, s) and (n, j).
    """
    if isinstance(X, GraspSet):
        recordings = X if manifest.knows_none else X.without_none()
        return recordings, *select_inputs(recordings, manifest)
    frames, grasps, s = np.asarray(X), np.asarray([] if y is None else y, np.str_), len(manifest.switches)
    if frames.shape != (len(grasps), s + len(manifest.joints)):
        raise CompileError(
            f"X has shape {frames.shape}: it needs a row for each of the {len(grasps)} names in y, and a column for "
            f"each of the build's {s} switches, then {len(manifest.joints)} joints"
        )
    recordings = GraspSet(
        switches=frames[:, :s],
        switch_names=tuple(switch.name for switch in manifest.switches),
        codes=frames[:, s:],
        joints=tuple(Joint(*structs.astuple(joint)[1:]) for joint in manifest.joints),
        grasps=grasps,
        taxonomy=own(np.unique(grasps).tolist()),
        subjects=np.full(len(grasps), "wearer"),
        objects=np.full(len(grasps), ANY),
        trials=np.arange(len(grasps)) if trials is None else np.asarray(trials),
    )
    recordings = recordings if manifest.knows_none else recordings.rows(recordings.grasps != NONE)
    return recordings, recordings.switches, recordings.codes


def _check_types(manifest: Manifest, recordings: GraspSet, add_type: Sequence[str]) -> None:
    """Raise CompileError for trials of unknown types, and for types that are not new or have no trials."""
    present = {*recordings.grasps.tolist()}
    if unknown := sorted(present - {*manifest.grasps, *add_type}):
        raise CompileError(
            f"the build does not know {list_names(unknown)}{nearest(unknown[0], manifest.grasps)}: leave these trials "
            "out, or teach new types with ``add_type``"
        )
    check_types(len(manifest.grasps) + len(add_type), CompileError)
    for number, name in enumerate(add_type):
        if name in (*manifest.grasps, *add_type[:number], NONE):
            raise CompileError(f"{shortened(name)} is no new type: leave it out of ``add_type``")
        if name not in present:
            raise CompileError(f"there are no trials of {shortened(name)} to teach it with: record three")


def _closed(switches: Sequence[Switch], trials: Samples, new: range) -> tuple[Switch, ...]:
    """Return the switches with the shares of the trials of `new` types in which they are closed."""

    def with_new(text: str, shares: NDArray[np.uint8]) -> str:
        return text and text[: 2 * new.start] + shares[new].tobytes().hex() + text[2 * new.start :]

    return tuple(
        structs.replace(
            switch,
            closed_least=with_new(switch.closed_least, least),
            closed_most=with_new(switch.closed_most, most),
        )
        for switch, least, most in zip(switches, *closed_shares(trials), strict=True)
    )


def _with_substitutes(
    made: IntegerTables,
    old: IntegerTables,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    adaptation: Adaptation,
) -> IntegerTables:
    """Return tables whose substitutes of lost inputs differ from the mean contributions in the person's frames, which
    they are in `made`, as much as they did before.
    """
    share, shares = bits.sum(axis=0)[:, np.newaxis] / len(bits), adaptation.shares(adaptation.everything)
    apart = [*(old.switch_means - share * old.switch_rows)]
    for joint, column in enumerate(codes.T):
        contribution = sum(term.of(column).astype(np.int64).sum(axis=0) for term in old.of_joint(joint))
        apart.append(old.joint_means[joint] - contribution / len(codes))
    means, s = np.vstack([made.switch_means, made.joint_means]), made.n_switches
    more = adaptation.with_new(np.reshape(apart, (len(means), old.n_classes)) * (made.scale / old.scale), shares)
    whole = np.rint(np.clip(means + more, *made.ends)).astype(np.int16)
    return in_bytes(replace(made, switch_means=whole[:s], joint_means=whole[s:]))


def _wider(
    rejection: Rejection | None,
    old: IntegerTables,
    tables: IntegerTables,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    labels: NDArray[np.intp],
    new: range,
) -> Rejection | None:
    """Return the limits in steps of the new tables, widened so that each contains the person's frames of its type.

    Those of `new` types contain the limits of all others: a few trials say little of what is beyond them.
    """
    if rejection is None:
        return None
    scores, count = tables.scores(bits, codes), bits.sum(axis=1)
    least = [math.floor(score * tables.scale / old.scale) for score in rejection.least_scores]
    closed, ranges = list(rejection.closed), list(rejection.ranges)
    for label in new:
        least.insert(label, min(least))
        closed.insert(label, _around(closed))
        ranges.insert(label, tuple(map(_around, zip(*ranges, strict=True))))
    for label in np.unique(labels).tolist():
        rows = labels == label
        least[label] = min(least[label], int(scores[rows, label].min()))
        fewest, most = closed[label]
        closed[label] = min(fewest, int(count[rows].min())), max(most, int(count[rows].max()))
        ends = zip(ranges[label], codes[rows].min(axis=0).tolist(), codes[rows].max(axis=0).tolist(), strict=True)
        ranges[label] = tuple((min(low, lowest), max(high, highest)) for (low, high), lowest, highest in ends)
    limits = {"least_scores": tuple(max(-LIMIT - 1, min(LIMIT, score)) for score in least)}
    return structs.replace(rejection, **limits, closed=tuple(closed), ranges=tuple(ranges))


def _around(limits: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """Return the limits that contain all these."""
    lowest, highest = zip(*limits, strict=True)
    return min(lowest), max(highest)


def _rescaled(segments: SegmentModel | None, ratio: float, new: range) -> SegmentModel | None:
    """Return the costs of segments for scores of `ratio` times as many units a step; `new` types cost the median."""
    if segments is None:
        return None
    shift, gain = gain_of(1.0, segments.gain * ratio / STEPS / 2.0 ** (8 + segments.shift))
    place, costs = new.start, {name: getattr(segments, name) for name in ("least", "stay", "enter", "leave", "direct")}
    for name, known in costs.items():
        costs[name] = (*known[:place], *(sorted(known[:place])[place // 2],) * len(new), *known[place:])
    return structs.replace(segments, shift=shift, gain=gain, **costs)


def _carried(folder: Path, manifest: Manifest) -> dict[str, bytes]:
    """Return the files of the other build that stay as they are."""
    kept = {SCAN_NAME: manifest.scan_sha256, HAND_NAME: manifest.hand_sha256}
    files = {name: read_member(folder / name, MAX_BYTES, digest) for name, digest in kept.items() if digest is not None}
    spec = sorted((folder / SPEC_FOLDER).glob("*")) if (folder / SPEC_FOLDER).is_dir() else []
    return files | {f"{SPEC_FOLDER}/{path.name}": read_member(path, MAX_BYTES) for path in spec}


def _warnings(personal: Manifest, adaptation: Adaptation, recordings: GraspSet) -> Iterator[str]:
    assert personal.adapted is not None
    first = np.unique(adaptation.trials, return_index=True)[1]
    for classes, trials in adaptation.contradictions.items():
        names = list_names([personal.grasps[number] for number in classes])
        numbers = list_names([str(recordings.trials[first[trial]]) for trial in sorted(trials)])
        yield (
            f"a frame is the same for {names}, in trials {numbers}: if one of these was labelled wrongly, leave it out"
        )
    if missing := [name for name, count in zip(personal.grasps, personal.adapted.counts, strict=True) if not count]:
        added = personal.adapted.added
        change = (
            f"some may be taken for {list_names(added)}" if added else "they change as the other types do on average"
        )
        yield f"no trials of {list_names(missing)}: {change}"
