"""The softmax of scores in integers: the same numbers in Python and in the C of firmware.

A score that is d steps behind the best has the power 2^15 * 2^-x, with x = d / (scale * ln 2): of one octave there are
64 powers, and straight lines between them. A probability is its power's share of all, in 65535ths.
"""

import math
from collections.abc import Sequence

_STEPS = 64  # of an octave
_OCTAVES = 16  # beyond this a power counts as 0
_WHOLE = 65535  # certainty

POWERS = tuple(round(2 ** (15 - step / _STEPS)) for step in range(_STEPS + 1))


class Softmax:
    """The softmax of scores of `scale` steps a unit. A distance times `step`, shifted by `shift`, is in 64ths of an
    octave.
    """

    __slots__ = ("shift", "step")

    def __init__(self, scale: float) -> None:
        each = _STEPS / (scale * math.log(2))
        self.shift = min(max(16 - math.frexp(each)[1], 8), 24)
        self.step = min(round(math.ldexp(each, self.shift)), _WHOLE)

    def probabilities(self, scores: Sequence[int]) -> list[int]:
        """Return the probability of each class, in 65535ths; less than K + 4 of them from the softmax."""
        best = max(scores)
        powers = [self._power((best - score) * self.step) for score in scores]
        all_of_them = sum(powers)
        return [(power * _WHOLE + all_of_them // 2) // all_of_them for power in powers]

    def _power(self, steps: int) -> int:
        octaves, at = divmod(steps >> self.shift, _STEPS)
        if octaves >= _OCTAVES:
            return 0
        above, below = POWERS[at : at + 2]
        between = steps >> self.shift - 8 & 255
        return above - ((above - below) * between >> 8) >> octaves
