"""Baselines that rank switches by information about the grasp type, or at random.

Ties of information, exactly compared, go to the lowest number.
"""

from collections.abc import Iterator
from functools import cmp_to_key
from itertools import pairwise

import numpy as np

from ...elementary import add_up, log
from ...samples import Columns
from ..cooccurrence import Cooccurrence
from ..exact import Floats, n_log_n
from ..inputs import PlacementError
from .base import Bits, Labels, Method, ranked

_SEED = 0


def random_placement(n_inputs: int, m: int, seed: int) -> Columns:
    """Return m distinct inputs out of n_inputs, drawn with `seed`; all of them, in drawn order, if m is larger."""
    if m < 0:
        raise PlacementError(f"{m} inputs were requested, a number >= 0 is needed")
    return tuple(np.random.default_rng(seed).permutation(n_inputs)[:m].tolist())


def _random(bits: Bits, _: Labels) -> Columns:
    return random_placement(bits.shape[1], bits.shape[1], _SEED)


def most_informative(bits: Bits, labels: Labels) -> Columns:
    """Return the inputs of bits (n, d) that vary, by the information of each, alone, about labels (n,)."""
    counts = _counted(bits, labels)
    scores = counts.information()
    # Bits of equal counts have equal information: one of them represents all.
    alike, kind = counts.kinds()

    def order(one: int, other: int) -> int:
        return -_sign(counts, scores[[alike[one], alike[other]]], (alike[one], None), (alike[other], None))

    ranks = np.zeros(len(alike), dtype=np.intp)
    for before, one in pairwise(sorted(range(len(alike)), key=cmp_to_key(order))):
        ranks[one] = ranks[before] + (order(before, one) != 0)
    return tuple(counts.varying[np.argsort(ranks[kind[counts.varying]], kind="stable")].tolist())


def cmim(bits: Bits, labels: Labels) -> Iterator[int]:
    """Yield the inputs of bits (n, d) that vary, by conditional mutual information maximisation.

    Fleuret, "Fast binary feature selection with conditional mutual information", JMLR 5 (2004), section 3.1: each time
    the input a of maximum  min over the chosen b of I(y; a | b),  first that of maximum I(y; a).
    """
    counts = _counted(bits, labels)
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


def mrmr(bits: Bits, labels: Labels) -> Iterator[int]:
    """Yield all inputs of bits (n, d) by minimum redundancy and maximum relevance to labels (n,).

    Peng, Long, Ding, "Feature selection based on mutual information", IEEE PAMI 27 (2005), equation 6 (the difference):
    each time the input a of maximum  I(y; a) - mean over the chosen b of I(a; b).  Counts are integers and logarithms
    are those of `elementary`, so every machine makes the same choice.
    """
    relevance = _information(bits, labels[:, None] == np.unique(labels))
    left = list(range(bits.shape[1]))
    chosen = 0
    redundancy = np.zeros(bits.shape[1])
    while left:
        scores = relevance - redundancy / max(chosen, 1)
        best = left[int(scores[left].argmax())]
        left.remove(best)
        chosen += 1
        yield best
        redundancy += _information(bits, np.stack([bits[:, best], ~bits[:, best]], axis=1))


def _counted(bits: Bits, labels: Labels) -> Cooccurrence:
    return Cooccurrence(bits, labels, int(labels.max(initial=-1)) + 1)


def _sign(counts: Cooccurrence, scores: Floats, one: tuple[int, int | None], other: tuple[int, int | None]) -> int:
    """Return the sign of I(class; a | b) of pair `one` minus that of pair `other`; `scores` are approximate values."""
    apart = scores[0] - scores[1]
    return counts.sign(one, other) if abs(apart) <= 2 * counts.error_bound else int(np.sign(apart))


def _information(bits: Bits, member: Bits) -> Floats:
    """Return n * I(a; class) in nats for every column a of bits (n, d), with class membership in member (n, k)."""
    n = len(bits)
    ones = member.T.astype(np.float64) @ bits.astype(np.float64)  # integers: exact in any order
    sizes = member.sum(axis=0, dtype=np.float64)[:, None]
    total = ones.sum(axis=0)
    joint = add_up(np.concatenate([n_log_n(ones, log), n_log_n(sizes - ones, log)]))
    apart: Floats = joint - n_log_n(total, log) - n_log_n(n - total, log) - add_up(n_log_n(sizes, log))
    return apart + n_log_n(np.array([n]), log)


MEMBER = (
    Method(
        name="mrmr",
        help="Greedy: most relevant to the grasp type, least redundant (mRMR)",
        learn=ranked(mrmr),
        nested=True,
        tried="always",
        rank=22,
    ),
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
        tried="always",
        label="top-k",
        rank=24,
    ),
    Method(
        name="random",
        help="Drawn at random (seeded) among those that vary",
        learn=ranked(_random),
        nested=True,
        tried="always",
        rank=25,
    ),
)
