"""Rejection: a frame unlike all training frames of a build has none of its grasp types, so nothing is held.

A frame is refused for its candidate, the grasp type with the largest score, in three cases: that score is below the
type's minimum; fewer or more switches are closed than the type's minimum and maximum; or more joints than `outside` are
beyond the type's ranges. All of these are integers, so Python and C refuse the same frames. Lost inputs are left out: a
lost switch may be closed or open, a lost joint lies within, and the score is judged only in frames without lost inputs.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .frames import Mask
from .manifest import Rejection
from .scores import LANE_OFFSET

_LEAST_SHARE, _EVEN = 1e-9, 0.5
# In a frame that is not refused, none trails by this many steps: no sum of scores comes near.
_NEVER = -(1 << 40)


def none_leads(rejection: Rejection, scale: float) -> tuple[int, int]:
    """Return the lead of none over the best score, at `scale` steps per unit, for a frame that is not refused and for
    one that is: there ln((1 - share) / share), where `share` is the share of grasps that are refused.
    """
    share = max(rejection.share, _LEAST_SHARE)
    return _NEVER, math.ceil(scale * math.log((1 - share) / share)) if share < _EVEN else 1


class Rejector:
    """Decides whether a build refuses a live frame."""

    __slots__ = ("_closed", "_least", "_outside", "_ranges")

    def __init__(self, rejection: Rejection) -> None:
        self._least = [least + LANE_OFFSET for least in rejection.least_scores]
        self._closed, self._ranges, self._outside = rejection.closed, rejection.ranges, rejection.outside

    def refuses(
        self,
        biased_scores: Sequence[int],
        closed: Mask,
        lost: Mask,
        codes: Sequence[int] | None,
        *,
        lost_joints: Mask = 0,
    ) -> bool:
        """Return whether nothing is held.

        Parameters
        ----------
        biased_scores : sequence of int
            The K scores, each 2^15 too high, as in `Scorer.biased_scores`.
        closed, lost : int
            Masks of the kept switches that are closed and lost.
        codes : sequence of int or None
            The joints' codes; None: all are lost.
        lost_joints : int
            A mask of the joints that are lost.
        """
        best = max(biased_scores)
        candidate = biased_scores.index(best)
        whole = not (lost or lost_joints or codes is None)
        if best < self._least[candidate] and whole:
            return True
        fewest, most = self._closed[candidate]
        seen = (closed & ~lost).bit_count()
        if seen > most or seen + lost.bit_count() < fewest:
            return True
        if codes is None:
            return False
        outside = 0
        for joint, (code, (low, high)) in enumerate(zip(codes, self._ranges[candidate], strict=True)):
            outside += not (low <= code <= high or lost_joints >> joint & 1)
        return outside > self._outside


def refused(
    rejection: Rejection, scores: NDArray[np.integer], bits: NDArray[np.bool_], codes: NDArray[np.integer]
) -> NDArray[np.bool_]:
    """Return which frames are refused (n,): scores (n, K), kept switches (n, s) and codes (n, j), nothing lost."""
    candidate = scores.argmax(axis=1)
    closed, ranges = np.array(rejection.closed), np.array(rejection.ranges).reshape(len(rejection.closed), -1, 2)
    count, (fewest, most), (low, high) = bits.sum(axis=1), closed[candidate].T, np.moveaxis(ranges[candidate], 2, 0)
    outside = ((codes < low) | (codes > high)).sum(axis=1)
    least = np.array(rejection.least_scores)[candidate]
    return np.asarray((scores.max(axis=1) < least) | (count < fewest) | (count > most) | (outside > rejection.outside))
