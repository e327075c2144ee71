"""Greedy selection by minimum redundancy and maximum relevance.

Peng, Long, Ding, "Feature selection based on mutual information", IEEE PAMI 27 (2005), equation 6 (the difference):
each time the input a of maximum  I(y; a) - mean over the chosen b of I(a; b).  Counts are whole numbers and logarithms
are elementary's, so that every machine chooses alike; equal scores go to the lowest number.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..elementary import add_up, log

Floats = NDArray[np.float64]


def mrmr(bits: NDArray[np.bool_], labels: NDArray[np.intp]) -> Iterator[int]:
    """Yield all inputs of bits (n, d) in the order in which they are chosen to tell labels (n,) apart."""
    relevance = _information(bits, labels[:, None] == np.unique(labels))
    open_inputs = list(range(bits.shape[1]))
    chosen = 0
    redundancy = np.zeros(bits.shape[1])
    while open_inputs:
        scores = relevance - redundancy / max(chosen, 1)
        best = open_inputs[int(scores[open_inputs].argmax())]
        open_inputs.remove(best)
        chosen += 1
        yield best
        redundancy += _information(bits, np.stack([bits[:, best], ~bits[:, best]], axis=1))


def _information(bits: NDArray[np.bool_], member: NDArray[np.bool_]) -> Floats:
    """Return n * I(a; class) in nats for every column a of bits (n, d), classes being given by member (n, k)."""
    n = len(bits)
    ones = member.T.astype(np.float64) @ bits.astype(np.float64)  # whole numbers: exact in any order
    sizes = member.sum(axis=0, dtype=np.float64)[:, None]
    total = ones.sum(axis=0)
    joint = add_up(np.concatenate([_f(ones), _f(sizes - ones)]))
    apart: Floats = joint - _f(total) - _f(n - total) - add_up(_f(sizes)) + _f(np.array([float(n)]))
    return apart


def _f(counts: Floats) -> Floats:
    """Return n ln n."""
    product: Floats = counts * log(np.maximum(counts, 1.0))
    return product
