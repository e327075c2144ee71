"""Baselines: by information about the grasp type, or at random.

Ties of information, exactly compared, go to the lowest number.
"""

from collections.abc import Iterator
from functools import cache, cmp_to_key

import numpy as np

from ...elementary import Floats
from ...samples import Columns, TrainingError
from ..gain import Cooccurrence
from .base import Bits, Labels, Method, ranked

_SEED = 0


def random_placement(n_inputs: int, m: int, seed: int) -> Columns:
    """Return m distinct inputs out of n_inputs, drawn with `seed`; all of them, in drawn order, if m is larger."""
    if m < 0:
        raise TrainingError(f"{m} inputs were requested, a number >= 0 is needed")
    return tuple(np.random.default_rng(seed).permutation(n_inputs)[:m].tolist())


def most_informative(bits: Bits, labels: Labels) -> Columns:
    """Return the inputs of bits (n, d) that vary, by the information of each, alone, about labels (n,)."""
    counts = Cooccurrence(bits, labels, int(labels.max(initial=-1)) + 1)
    scores = counts.information()
    # Of very many inputs few differ in their counts, and the same counts are the same information.
    _, firsts, kinds = np.unique(counts.ones, axis=1, return_index=True, return_inverse=True)

    @cache
    def order(one: int, other: int) -> int:
        return -_sign(counts, scores[[one, other]], (one, None), (other, None))

    return tuple(sorted(counts.varying.tolist(), key=lambda bit: cmp_to_key(order)(int(firsts[kinds.flat[bit]]))))


def cmim(bits: Bits, labels: Labels) -> Iterator[int]:
    """Yield the inputs of bits (n, d) that vary, by conditional mutual information maximisation.

    Fleuret, "Fast binary feature selection with conditional mutual information", JMLR 5 (2004), section 3.1: each time
    the input a of maximum  min over the chosen b of I(y; a | b),  first that of maximum I(y; a).
    """
    counts = Cooccurrence(bits, labels, int(labels.max(initial=-1)) + 1)
    left: list[int] = counts.varying.tolist()
    scores = counts.information()
    given: dict[int, int | None] = dict.fromkeys(left)
    while left:
        least = scores[left].max() - 2 * counts.error_bound
        best, *others = (a for a in left if scores[a] >= least)
        for a in others:
            if counts.sign((a, given[a]), (best, given[best])) > 0:
                best = a
        left.remove(best)
        yield best
        conditional = counts.information(best)
        for a in left:
            if _sign(counts, np.array([conditional[a], scores[a]]), (a, best), (a, given[a])) < 0:
                scores[a], given[a] = conditional[a], best


def _sign(counts: Cooccurrence, scores: Floats, one: tuple[int, int | None], other: tuple[int, int | None]) -> int:
    """Return the sign of I(class; a | b) of pair `one` minus that of pair `other`; `scores` are approximate values."""
    apart = scores[0] - scores[1]
    return counts.sign(one, other) if abs(apart) <= 2 * counts.error_bound else int(np.sign(apart))


MEMBER = (
    Method(
        name="cmim",
        help="Greedy by conditional mutual information (CMIM)",
        learn=ranked(cmim),
        nested=True,
        label="CMIM",
        rank=23,
    ),
    Method(
        name="mutual-information",
        help="Highest information about the grasp type, each switch alone",
        learn=ranked(most_informative),
        nested=True,
        label="top-k",
        rank=24,
    ),
    Method(
        name="random",
        help="Drawn at random (seeded) among those that vary",
        learn=ranked(lambda bits, _: random_placement(bits.shape[1], bits.shape[1], _SEED)),
        nested=True,
        rank=25,
    ),
)
