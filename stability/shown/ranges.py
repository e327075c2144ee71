"""How far probabilities and weights spread over the rounds of a long training: what the picture shows."""

import math

import msgspec

from thenar.compiler.boosting.boost import boost

from ..checks.rounds import Moment, mean_score, moments
from ..inputs.hard_data import Floats, HardSet


class Ranges(msgspec.Struct, frozen=True):
    """The state after every round, lists of as many numbers as there are rounds.

    Least and greatest of what is above 0, NaN where nothing is; mean_scores are the largest |mean over the classes of
    F| of any row.
    """

    name: str
    least_probability: list[float]
    greatest_probability: list[float]
    least_weight: list[float]
    greatest_weight: list[float]
    losses: list[float]
    mean_scores: list[float]


def ranges_of(hard: HardSet, rounds: int) -> Ranges:
    """Train on `hard` and return the ranges."""
    stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, weights=hard.weights)
    numbers = [_numbers(moment) for moment in moments(hard, stumps)][1:]
    return Ranges(hard.name, *(list(series) for series in zip(*numbers, strict=True)))


def _numbers(moment: Moment) -> tuple[float, ...]:
    return (*_ends(moment.shares), *_ends(moment.weights), moment.loss, mean_score(moment.scores))


def _ends(numbers: Floats) -> tuple[float, float]:
    positive = numbers[numbers > 0]
    return (float(positive.min()), float(positive.max())) if positive.size else (math.nan, math.nan)
