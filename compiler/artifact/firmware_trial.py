"""A compiled classifier on trial: its answers beside Python's, frame by frame and score by score."""

from typing import Literal

import numpy as np
from msgspec import Struct

from thenar.runtime.build import Build
from thenar.runtime.scores import LANE_OFFSET

from ..firmware.answers import Answers
from ..firmware.classifier import classifier_files
from ..firmware.host_runner import run as run_on_host
from ..firmware.library import Fit
from ..firmware.library_names import LIBRARY_NAME
from ..firmware.probes import Probes, joined
from ..firmware.running import run

Answer = Literal["classify", "update"]
ANSWERS: tuple[Answer, ...] = ("classify", "update")


class Difference(Struct, frozen=True):
    """A frame that is answered otherwise: which it is, what is closed and coded in it, and both answers."""

    frame: str
    closed: tuple[str, ...]
    codes: tuple[int, ...]
    grasp: str
    scores: tuple[int, ...]
    compiled_grasp: str
    compiled_scores: tuple[int, ...]


class TargetCheck(Struct, frozen=True, kw_only=True):
    """What came of one part.

    layout     which layout was compiled, and why
    answer     "classify": every frame from nothing; "update": from what changed since the frame before
    frames     how many were answered, `differing` of them with another score or grasp type than in Python
    first      the first of those
    misnamed   how many grasp types thenar_NAME_grasp calls otherwise than the manifest; None: not asked, on an AVR
    worst      what the slowest answer took, in `unit`, and `stack` the bytes that answers need; None: not counted
    """

    part: str
    layout: str
    answer: Answer
    frames: int
    differing: int
    first: Difference | None
    misnamed: int | None
    worst: int | None
    unit: str
    stack: int | None


class FirmwareTrial:
    """Frames, in three lots, and Python's scores of them: those of the very `Build` that the runtime runs."""

    def __init__(self, build: Build, rows: Probes, extreme: Probes, random: Probes) -> None:
        self._build, self._lots = build, (("row", rows), ("extreme frame", extreme), ("random frame", random))
        self._frames = joined(rows, extreme, random)
        pairs = zip(self._frames.bits, self._frames.codes, strict=True)
        self._scores = np.array([build.lanes(bits, codes) for bits, codes in pairs]) - LANE_OFFSET

    def check(self, fit: Fit, answer: Answer) -> TargetCheck:
        """Compile the classifier as `fit` says and hold its answers against Python's. Raises FirmwareError."""
        answers = self._run(fit, incremental=answer == "update")
        wrong = (answers.scores != self._scores).any(axis=1) | (answers.classes != self._scores.argmax(axis=1))
        return TargetCheck(
            part=fit.target.part,
            layout=fit.choice.why,
            answer=answer,
            frames=len(wrong),
            differing=int(np.count_nonzero(wrong)),
            first=self._difference(int(wrong.argmax()), answers) if wrong.any() else None,
            misnamed=self._misnamed(answers),
            worst=None if answers.cost is None else int(answers.cost.max()),
            unit=answers.unit,
            stack=answers.stack,
        )

    def _misnamed(self, answers: Answers) -> int | None:
        if answers.names is None:
            return None
        return sum(name != grasp for name, grasp in zip(answers.names, self._build.grasps, strict=True))

    def _run(self, fit: Fit, *, incremental: bool) -> Answers:
        layout, target = fit.choice.layout, fit.target
        files = classifier_files(LIBRARY_NAME, self._build.manifest, layout, avr=target.kind == "avr")
        frames = layout.frame_bytes(self._frames.bits, self._frames.codes)
        if target.kind == "host":
            return run_on_host(files, LIBRARY_NAME, layout, target, frames, incremental=incremental, sanitize=True)
        return run(files, LIBRARY_NAME, layout, target, frames, incremental=incremental)

    def _difference(self, frame: int, answers: Answers) -> Difference:
        build, bits, codes = self._build, self._frames.bits[frame], self._frames.codes[frame]
        return Difference(
            frame=self._name(frame),
            closed=tuple(switch.name for switch, bit in zip(build.manifest.switches, bits, strict=True) if bit),
            codes=tuple(codes.tolist()),
            grasp=build.grasps[int(self._scores[frame].argmax())],
            scores=tuple(self._scores[frame].tolist()),
            compiled_grasp=self._grasp(int(answers.classes[frame])),
            compiled_scores=tuple(answers.scores[frame].tolist()),
        )

    def _name(self, frame: int) -> str:
        for name, lot in self._lots:
            if frame < len(lot):
                return f"{name} {frame}"
            frame -= len(lot)
        raise IndexError(frame)

    def _grasp(self, number: int) -> str:
        return self._build.grasps[number] if number < len(self._build.grasps) else f"type {number}, which there is not"
