"""Which points are best: those that no other beats at no higher price."""

from collections.abc import Callable, Sequence
from typing import TypeVar

_T = TypeVar("_T")

# A point has to recognise so much better than all that are no dearer, a twentieth of a percent: less is the cut's luck.
STEP = 0.0005


def front(
    items: Sequence[_T], price: Callable[[_T], float], worth: Callable[[_T], float], step: float = STEP
) -> list[_T]:
    """Return the items, from the cheapest up, each of which is worth more, by `step`, than every cheaper one before it.

    Of equal price the one that is worth most counts, of equal worth too the first.
    """
    best: list[_T] = []
    for item in sorted(items, key=lambda item: (price(item), -worth(item))):
        if not best or worth(item) >= worth(best[-1]) + step:
            best.append(item)
    return best
