"""A probability out of integer scores, worked out only to be published: no decision rests on it."""

import math
from collections.abc import Sequence


def softmax(scores: Sequence[int], number: int, scale: float) -> float:
    """Return the softmax of `scores` (K,), in steps of 1 / `scale`, for class `number`; it cannot overflow."""
    best = max(scores)
    return math.exp((scores[number] - best) / scale) / sum([math.exp((score - best) / scale) for score in scores])
