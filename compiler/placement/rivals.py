"""Placements of a given size to hold beside ID3's: drawn at random, by information alone, by greedy forward selection.

Inputs are bits. An input that is constant is never chosen; if fewer than m vary, fewer are returned. Equal amounts of
information, exactly compared, are decided by the lowest number.
"""

from collections.abc import Iterator
from functools import cmp_to_key
from itertools import islice, pairwise

import numpy as np
import numpy.typing as npt

from .cooccurrence import Cooccurrence
from .errors import PlacementError
from .inputs import check_bits, check_labels


def random_placement(n_inputs: int, m: int, seed: int) -> tuple[int, ...]:
    """Return m different inputs out of n_inputs, drawn with `seed`; all of them, in drawn order, if m is larger."""
    _check_size(m)
    return tuple(np.random.default_rng(seed).permutation(n_inputs)[:m].tolist())


def top_mutual_information(X: npt.ArrayLike, y: npt.ArrayLike, m: int) -> tuple[int, ...]:
    """Return the m inputs of X (n, d) that each, alone, tell most about y (n,), the best one first."""
    _check_size(m)
    counts = _count(X, y)
    scores = counts.information()

    # Bits of equal counts tell the same: one of them stands for all.
    alike, kind = counts.kinds()

    def compare(one: int, other: int) -> int:
        a, b = alike[one], alike[other]
        apart = scores[b] - scores[a]
        exactly = abs(apart) <= 2 * counts.error_bound
        return counts.sign((b, None), (a, None)) if exactly else int(np.sign(apart))

    ranks = np.zeros(len(alike), dtype=np.intp)
    for before, one in pairwise(sorted(range(len(alike)), key=cmp_to_key(compare))):
        ranks[one] = ranks[before] + (compare(before, one) != 0)
    best = counts.varying[np.argsort(ranks[kind[counts.varying]], kind="stable")]
    return tuple(best[:m].tolist())


def forward_cmim(X: npt.ArrayLike, y: npt.ArrayLike, m: int) -> tuple[int, ...]:
    """Return m inputs by conditional mutual information maximisation, in the order they were chosen.

    Fleuret, "Fast binary feature selection with conditional mutual information", JMLR 5 (2004), section 3.1: each time
    the input a of maximum  min over the chosen b of I(y; a | b),  first that of maximum I(y; a).
    """
    _check_size(m)
    return tuple(islice(cmim_order(X, y), m))


def cmim_order(X: npt.ArrayLike, y: npt.ArrayLike) -> Iterator[int]:
    """Yield what `forward_cmim` chooses, one input after the other."""
    counts = _count(X, y)
    open_inputs: list[int] = counts.varying.tolist()
    scores = counts.information()
    given: dict[int, int | None] = dict.fromkeys(open_inputs)
    while open_inputs:
        best = _best(counts, scores, given, open_inputs)
        open_inputs.remove(best)
        yield best
        _lower(counts, scores, given, open_inputs, best)


def _best(
    counts: Cooccurrence, scores: npt.NDArray[np.float64], given: dict[int, int | None], open_inputs: list[int]
) -> int:
    """Return the input of the largest score, the lowest number of those that are exactly equal."""
    least = scores[open_inputs].max() - 2 * counts.error_bound
    best, *others = (a for a in open_inputs if scores[a] >= least)
    for a in others:
        if counts.sign((a, given[a]), (best, given[best])) > 0:
            best = a
    return best


def _lower(
    counts: Cooccurrence,
    scores: npt.NDArray[np.float64],
    given: dict[int, int | None],
    open_inputs: list[int],
    chosen: int,
) -> None:
    """Take the input just chosen into each open input's minimum."""
    conditional = counts.information(chosen)
    for a in open_inputs:
        apart = conditional[a] - scores[a]
        exactly = abs(apart) <= 2 * counts.error_bound
        if (counts.sign((a, chosen), (a, given[a])) if exactly else apart) < 0:
            scores[a], given[a] = conditional[a], chosen


def _count(X: npt.ArrayLike, y: npt.ArrayLike) -> Cooccurrence:
    bits = check_bits(X)
    classes, labels = check_labels(y, len(bits))
    return Cooccurrence(bits, labels, len(classes))


def _check_size(m: int) -> None:
    if m < 0:
        raise PlacementError(f"{m} inputs were asked for, a number >= 0 is needed")
