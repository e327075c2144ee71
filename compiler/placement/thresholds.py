"""Switches of taxels: a threshold each, between two codes, learnt from the rows that are trained on.

A taxel is closed above its threshold. Of all thresholds between codes that occur, the one is taken that tells most
about the grasp type (as C4.5 splits a number), exactly; of equal ones the lowest. It lies midway between the two codes.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..samples import Samples
from .gain import NodeCounts, best_position

Thresholds = tuple[int, ...]


def taxel_thresholds(samples: Samples) -> Thresholds:
    """Return the threshold of each taxel: the largest code that is open still."""
    return tuple(_threshold(column, samples.labels, samples.n_classes) for column in samples.taxels.T)


def _threshold(codes: NDArray[np.uint16], labels: NDArray[np.intp], n_classes: int) -> int:
    values, place = np.unique(codes, return_inverse=True)
    if len(values) == 1:
        # Nothing is known of what else there may be.
        return int(values[0])
    counts = np.zeros((n_classes, len(values)), np.int64)
    np.add.at(counts, (labels, place), 1)
    totals = counts.sum(axis=1)
    above = totals[:, np.newaxis] - np.cumsum(counts, axis=1)[:, :-1]
    splits = np.arange(len(values) - 1)
    best = best_position(NodeCounts(totals, above, splits), splits) or 0
    return (int(values[best]) + int(values[best + 1])) // 2


def with_switches(samples: Samples, thresholds: Thresholds) -> Samples:
    """Return samples without taxels, whose last switches are the taxels above these thresholds."""
    if not samples.taxels.shape[1]:
        return samples
    closed = samples.taxels > np.array(thresholds, np.int64)
    return replace(samples, switches=np.hstack([samples.switches, closed]), taxels=samples.taxels[:, :0])


def made_plain(samples: Samples) -> Samples:
    """Return samples without taxels: switches of them, by the thresholds learnt from all of these rows."""
    return with_switches(samples, taxel_thresholds(samples))
