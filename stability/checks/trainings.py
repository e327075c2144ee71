"""Whole trainings against the same at 60 digits: each round from its own scores, and all of them from the start."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import Stumps

from ..finding import Finding, Worst
from ..reference.ensembles import Round, boost_rounds
from ..reference.numbers import precisely
from .branches import choice_error
from .class_rounds import ClassRound, branches, class_rounds, see_stump
from .growth import Step, grown, step_of

REFERENCE = "60 digits"
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Training:
    """A small training set, X (n, d) and labels (n,), and its options."""

    name: str
    X: Floats
    labels: NDArray[np.intp]
    classes: int
    shrinkage: float
    z_max: float

    def boosted(self, rounds: int) -> Stumps:
        """Return our ensemble."""
        return boost(self.X, self.labels, self.classes, rounds=rounds, shrinkage=self.shrinkage, z_max=self.z_max)[0]

    def boosted_precisely(self, rounds: int) -> list[Round]:
        """Return the reference's rounds."""
        X, labels = self.X.tolist(), self.labels.tolist()
        return boost_rounds(X, labels, self.classes, rounds, self.shrinkage, self.z_max)


def trainings(full: bool) -> Iterator[Finding]:
    """Yield errors of rounds given the scores before them, and of scores after all rounds."""
    rng, rounds = np.random.default_rng(5), 40 if full else 8
    stumps = Worst("stumps of whole trainings", REFERENCE, 1.0, "x rounding")
    answers = Worst("answers of a round, from its scores", REFERENCE, 1.0, "x rounding")
    scores = Worst("scores after all rounds, from the start", REFERENCE, 1.0, "x growth")
    for training in _sets(rng, 36 if full else 20):
        ours = training.boosted(rounds)
        stages = [np.zeros((len(training.X), training.classes)), *ours.staged_scores(training.X)]
        for number, F in enumerate(stages[:-1]):
            at = f"{training.name}, round {number + 1}"
            for given in class_rounds(F.tolist(), training.labels.tolist(), training.z_max):
                see_stump(given, training.X, ours, number, training.z_max, at, stumps, answers)
        _see_scores(training, stages, scores)
    yield from (stumps.finding(), answers.finding(), scores.finding())


def _see_scores(training: Training, stages: Sequence[Floats], scores: Worst) -> None:
    """Hold the scores of our training against those of the reference's, as long as no choice in it is in doubt."""
    rounds = training.boosted_precisely(len(stages) - 1)
    F = [[mpf(0)] * training.classes for _ in training.labels]
    labels, steps, truth = training.labels.tolist(), list[Step](), F
    for each, ours in zip(rounds, stages[1:], strict=True):
        given = class_rounds(truth, labels, training.z_max)
        if _in_doubt(training, each, given):
            break
        parts = [branches(training.X[:, splits[0][1]], splits[0][2]) for splits in each.splits]
        largest = float(np.abs(ours).max())
        steps.append(step_of(given, parts, labels, training.shrinkage, training.z_max, largest))
        truth = each.scores
    if not steps:
        return
    reached = stages[len(steps)]
    with precisely():
        errors = [
            abs(mpf(a) - b)
            for row, true in zip(reached.tolist(), truth, strict=True)
            for a, b in zip(row, true, strict=True)
        ]
    ratios = np.array([float(error) for error in errors]) / grown(steps)
    scores.see(float(ratios.max()), f"{training.name}, {len(steps)} rounds, off by {float(max(errors)):.2g}")


def _in_doubt(training: Training, each: Round, given: Sequence[ClassRound]) -> bool:
    """Whether rounding may part equal from unequal stumps, or take a branch for empty or not."""
    for splits, lead, of in zip(each.splits, each.leads(), given, strict=True):
        best, column, lower, _ = splits[0]
        light = [of.branch(rows).is_light for rows in branches(training.X[:, column], lower) if rows]
        if any(light) or lead * best <= 2 * choice_error(of.weights, of.responses, training.z_max):
            return True
    return False


def _sets(rng: np.random.Generator, n: int) -> Iterator[Training]:
    """Yield sets of switches, codes and numbers that may be missing: noisy, separable, and of random labels."""
    for name, classes, noise, shrinkage, z_max in (
        ("noisy", 3, 0.2, 1.0, 3.0),
        ("separable", 4, 0.0, 1.0, 3.0),
        ("random labels", 2, 1.0, 1.0, 3.0),
        ("shrunk", 3, 0.1, 0.3, 2.0),
        ("hardly clamped", 3, 0.1, 1.0, 100.0),
    ):
        labels = np.arange(n) % classes
        switches = rng.random((classes, 3))[labels] + noise * rng.normal(0, 1, (n, 3)) > 0.5
        codes = 20 * labels + rng.integers(0, 20, n) + (200 * noise * rng.random(n)).astype(np.int64)
        lacking = np.where(rng.random(n) < 0.3, np.nan, rng.integers(0, 5, n))
        yield Training(name, np.column_stack([switches, codes, lacking]), labels, classes, shrinkage, z_max)
