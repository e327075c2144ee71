"""Compare compiled classifiers with Python, in every score of every frame that is tried.

Also check whether a build's firmware is the firmware that thenar would generate for it today.
"""

from collections.abc import Sequence
from functools import cached_property
from itertools import compress, product
from pathlib import Path

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.build import Build
from thenar.runtime.files import read_file
from thenar.runtime.manifest import Manifest
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.scores import LANE_OFFSET

from ..firmware import FirmwareError
from ..firmware.classifier import FIRMWARE_NAME, LIBRARY_FILES, LIBRARY_NAME, Library
from ..firmware.costs import PartFit, fit_for, smallest_fit
from ..firmware.generate import LARGEST
from ..firmware.probes import Predictions, Probes, extreme_frames, joined, lost_inputs, random_frames, states_of
from ..firmware.softmax import Softmax
from ..firmware.targets import TARGETS
from ..firmware.targets import kinds as every_kind
from ..recordings.graspset import GraspSet
from ..samples import select_inputs
from ..trainers.base import Report

RANDOM_FRAMES = 10_000
_SEED = 1


def made_firmware(manifest: Manifest, tables: IntegerTables) -> tuple[dict[str, str], str]:
    """Return path in the build -> text of its firmware, and its target or why there is none, in words."""
    try:
        fit = smallest_fit(tables)
        made = Library(LIBRARY_NAME, manifest, fit.layout, fit.notes()).whole
    except FirmwareError as reason:
        return {}, f"none: {reason}"
    return {f"{FIRMWARE_NAME}/{name}": text for name, text in made.items()}, fit.words


def outdated_firmware(folder: Path, build: Build) -> tuple[str, ...] | None:
    """Return which files of the build's folder `firmware/` differ from those generated now; None without it."""
    if not (folder / FIRMWARE_NAME).is_dir():
        return None
    made, _ = made_firmware(build.manifest, build.tables)
    now = {name: text.encode() for name, text in made.items()}
    names = [f"{FIRMWARE_NAME}/{name}" for name in LIBRARY_FILES]
    return tuple(name for name in names if now.get(name) != _content(folder / name))


def _content(path: Path) -> bytes | None:
    try:
        return read_file(path, LARGEST, FirmwareError)
    except (OSError, FirmwareError):
        return None


class Difference(Struct, frozen=True):
    """A frame with different results: its inputs (closed, coded, missing), and the results of both sides.

    `said` holds the margin and the probability of one grasp type, in 65535ths, and the state of segments, where
    they were requested.
    """

    frame: str
    closed: tuple[str, ...]
    codes: tuple[int, ...]
    grasp: str
    scores: tuple[int, ...]
    compiled_grasp: str
    compiled_scores: tuple[int, ...]
    said: tuple[int, ...] = ()
    compiled_said: tuple[int, ...] = ()
    lost: tuple[str, ...] = ()


class TargetCheck(Struct, frozen=True, kw_only=True):
    """The result for one part.

    missing    whether inputs are missing in every frame; in every second frame it is a single one
    frames     how many were classified; `differing` of them differ from Python in a score, grasp type, margin,
               probability or state of a segment
    shares     whether margins and probabilities were requested: on an AVR only where inputs are missing
    states     whether the states of the decoder of segments were: not on an AVR, nor of a build without segments
    first      the first differing frame
    misnamed   how many grasp types thenar_name() names differently from the manifest; None: not tested, on an AVR
    worst      the cost of the slowest call, in `unit`; `stack`: bytes of stack that a call needs; None: not counted
    """

    part: str
    missing: bool
    shares: bool
    states: bool = False
    frames: int
    differing: int
    first: Difference | None
    misnamed: int | None
    worst: int | None
    unit: str
    stack: int | None


class FirmwareTrial:
    """Frames, in three sets, and their scores in Python, from the same `Build` that the runtime uses."""

    def __init__(self, build: Build, rows: Probes, extreme: Probes, random: Probes) -> None:
        self._build, self._lots = build, (("row", rows), ("extreme frame", extreme), ("random frame", random))
        self._frames = joined(rows, extreme, random)
        pairs = zip(self._frames.bits, self._frames.codes, strict=True)
        self._scores = np.array([build.scorer.biased_scores(bits, codes) for bits, codes in pairs]) - LANE_OFFSET
        self._lost = lost_inputs(build.tables, len(self._frames), _SEED)

    @cached_property
    def _scores_without(self) -> NDArray[np.int64]:
        """Return the scores with the `_lost` inputs missing."""
        frames = zip(self._frames.bits, self._frames.codes, self._lost, strict=True)
        switches = self._build.tables.n_switches
        without = self._build.scorer.biased_scores
        biased_scores = [without(bits, codes, lost[:switches], lost[switches:]) for bits, codes, lost in frames]
        return np.array(biased_scores) - LANE_OFFSET

    def check(self, fit: PartFit, *, missing: bool = False) -> TargetCheck:
        """Compile the classifier with layout `fit` and compare its results with Python's. Raises FirmwareError."""
        layout, target = fit.layout, fit.target
        files = target.sources(Library(LIBRARY_NAME, self._build.manifest, layout))
        frames = layout.frame_bytes(self._frames.bits, self._frames.codes)
        found = target.run(files, LIBRARY_NAME, layout, frames, lost=self._lost if missing else None)
        scores = self._scores_without if missing else self._scores
        # On an AVR only classify() is timed; decide(), which rejects, runs on the frames with missing inputs.
        bare = target.avr and not missing
        classes = scores.argmax(axis=1) if bare else self._classes(scores, missing=missing)
        wrong = (found.scores != scores).any(axis=1) | (found.classes != classes)
        if (said := _said(found)) is not None:
            expected = self._said(found, missing=missing)
            wrong |= (said != expected).any(axis=1)
        pairs = None if found.names is None else zip(found.names, self._build.grasps, strict=True)
        return TargetCheck(
            part=target.part,
            missing=missing,
            shares=said is not None,
            frames=len(wrong),
            differing=int(np.count_nonzero(wrong)),
            states=found.states is not None,
            first=self._difference(int(wrong.argmax()), found, missing=missing) if wrong.any() else None,
            misnamed=None if pairs is None else sum(name != grasp for name, grasp in pairs),
            worst=None if found.cost is None else int(found.cost.max()),
            unit=found.unit,
            stack=found.stack,
        )

    def _classes(self, scores: NDArray[np.int64], *, missing: bool) -> NDArray[np.intp]:
        """Return the class of each frame (n,); rejected frames get the number of classes."""
        rejector, (n, k), found = self._build.scorer.rejector, scores.shape, np.asarray(scores.argmax(axis=1))
        if rejector is None:
            return found
        lost = self._lost if missing else np.zeros((n, self._frames.bits.shape[1] + self._frames.codes.shape[1]), bool)
        at = self._frames.bits.shape[1]
        closed, gone = (self._frames.bits & ~lost[:, :at]).sum(axis=1), lost[:, :at].sum(axis=1)
        packed = np.packbits(lost[:, at:], axis=1, bitorder="little")
        joints = [int.from_bytes(row.tobytes(), "little") for row in packed]
        counts = closed.tolist(), gone.tolist(), joints, self._frames.codes.tolist()
        refused = [
            rejector.refuses(own, shut, off, codes, lost_joints=silent)
            for own, shut, off, silent, codes in zip((scores + LANE_OFFSET).tolist(), *counts, strict=True)
        ]
        return np.asarray(np.where(refused, k, found))

    def _said(self, found: Predictions, *, missing: bool) -> NDArray[np.int64]:
        """Return the margin of each frame and the probability of one grasp type, cycling through the types, (n, 2);
        then, where the program decodes segments, their state, (n, 3).
        """
        scores = self._scores_without if missing else self._scores
        best, second = np.sort(scores, axis=1)[:, :-3:-1].T
        softmax = Softmax(self._build.tables.scale)
        shares = [softmax.probabilities(own)[n % len(own)] for n, own in enumerate(scores.tolist())]
        states = []
        if found.states is not None:
            model = self._build.manifest.segments
            assert model is not None
            states = [states_of(model, scores, self._classes(scores, missing=missing) == scores.shape[1])]
        return np.stack([best - second, shares, *states], axis=1).astype(np.int64)

    def _difference(self, frame: int, found: Predictions, *, missing: bool) -> Difference:
        scores = self._scores_without if missing else self._scores
        described = self._build.manifest
        inputs = [*(switch.name for switch in described.switches), *(joint.name for joint in described.joints)]
        build, bits, codes = self._build, self._frames.bits[frame], self._frames.codes[frame]
        said, number = _said(found), int(found.classes[frame])
        return Difference(
            frame=self._name(frame),
            closed=tuple(switch.name for switch, bit in zip(build.manifest.switches, bits, strict=True) if bit),
            codes=tuple(codes.tolist()),
            grasp=build.grasps[int(scores[frame].argmax())],
            scores=tuple(scores[frame].tolist()),
            compiled_grasp=build.grasps[number] if number < len(build.grasps) else f"type {number}, which is unknown",
            compiled_scores=tuple(found.scores[frame].tolist()),
            said=() if said is None else tuple(self._said(found, missing=missing)[frame].tolist()),
            compiled_said=() if said is None else tuple(said[frame].tolist()),
            lost=tuple(compress(inputs, self._lost[frame])) if missing else (),
        )

    def _name(self, frame: int) -> str:
        for name, lot in self._lots:
            if frame < len(lot):
                return f"{name} {frame}"
            frame -= len(lot)
        raise IndexError(frame)


def _said(found: Predictions) -> NDArray[np.int64] | None:
    """Return the margins and probabilities of a program, and the states of segments, (n, 2 or 3); None where they were
    not requested.
    """
    if found.margins is None or found.shares is None:
        return None
    states = [] if found.states is None else [found.states]
    return np.stack([found.margins, found.shares, *states], axis=1).astype(np.int64)


class FirmwareVerification(Struct, frozen=True, kw_only=True):
    """The result of firmware verification: each check on the same rows, extreme and random frames, and the outdated
    files of the build's own `firmware/`; None if it has none.
    """

    rows: int
    extreme: int
    random: int
    checks: tuple[TargetCheck, ...]
    outdated: tuple[str, ...] | None

    @property
    def holds(self) -> bool:
        """Whether every score, grasp type, margin, probability and name agrees, and the build's own firmware, if any,
        is up to date.
        """
        return not self.outdated and not any(check.differing or check.misnamed for check in self.checks)


def verify_firmware(
    folder: str | Path,
    grasp_set: GraspSet,
    kinds: Sequence[str],
    progress: Report | None = None,
) -> FirmwareVerification:
    """Compile the classifier for `kinds` and compare it with Python: every row, extreme frames, 10,000 random frames.

    "host" runs with the address and undefined behaviour sanitizers, "avr" is the smallest AVR that fits the classifier.
    Each classifies every frame, then once more with inputs missing, one at a time and several at once. Except on "avr",
    every name is read.
    Raises FirmwareError where a tool is missing, a kind is not in `firmware.targets.kinds()`, or the build does not fit
    a part; otherwise raises as `verify` does.
    """
    if unknown := [kind for kind in kinds if kind not in every_kind()]:
        raise FirmwareError(f"no simulator runs firmware for {unknown[0]!r}: choose from {', '.join(every_kind())}")
    build = Build.load(folder)
    fits = []
    for kind in (kind for kind in every_kind() if kind in kinds):
        first, *more = (target for target in TARGETS.values() if target.kind == kind)
        # The smallest part of the kind that fits.
        fits.append(fit := smallest_fit(build.tables, kind=kind) if more else fit_for(first, build.tables))
        if lack := fit.target.missing():
            raise FirmwareError(f"firmware for {fit.target.part} cannot be run here: {lack}")
    bits, codes = select_inputs(grasp_set, build.manifest)
    extreme, random = extreme_frames(build.tables), random_frames(build.tables, RANDOM_FRAMES, _SEED)
    trial = FirmwareTrial(build, Probes(bits, codes), extreme, random)
    runs = list(product(fits, (False, True)))
    checks: list[TargetCheck] = []
    for fit, missing in runs:
        if progress is not None:
            progress(len(checks), len(runs))
        checks.append(trial.check(fit, missing=missing))
    return FirmwareVerification(
        rows=len(bits),
        extreme=len(extreme),
        random=len(random),
        checks=tuple(checks),
        outdated=outdated_firmware(Path(folder), build),
    )
