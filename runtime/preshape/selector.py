"""When a robot hand shall change its preshape: only on a grasp type that is sure, and has been for a moment."""

from ..live.published import UNKNOWN, LiveGrasp
from .preshape import Preshape, PreshapeError
from .table import PreshapeTable

MIN_PROBABILITY = 0.8
SETTLE_MS = 100


class PreshapeSelector:
    """Holds the last confident preshape.

    It changes to another only when that one was called for by every frame of the last `settle_ms`, each with at least
    `min_probability`. In between it answers with the preshape that it holds; on "unknown", and on a grasp type that the
    table does not name, with none: whoever moves the hand then leaves it where it is.
    """

    __slots__ = ("_called", "_held", "_min_probability", "_settle_us", "_since_us", "_table")

    def __init__(
        self, table: PreshapeTable, *, min_probability: float = MIN_PROBABILITY, settle_ms: float = SETTLE_MS
    ) -> None:
        """Raise PreshapeError unless 0 <= min_probability <= 1 and settle_ms >= 0."""
        if not 0 <= min_probability <= 1:
            raise PreshapeError(f"the least probability of a preshape lies between 0 and 1, not at {min_probability}")
        if not settle_ms >= 0:
            raise PreshapeError(f"a preshape settles within 0 ms or more, not {settle_ms}")
        self._table = table
        self._min_probability = min_probability
        self._settle_us = settle_ms * 1000
        self._held: Preshape | None = None
        self._called: Preshape | None = None
        self._since_us = 0

    def update(self, grasp: LiveGrasp) -> Preshape | None:
        """Return the preshape that the hand shall have now, or None where it shall be told nothing."""
        if grasp.grasp == UNKNOWN or grasp.health == "unknown":
            self._called = None
            return None
        wanted = self._table.find(grasp.grasp)
        self._call(wanted if grasp.probability >= self._min_probability else None, grasp.time_us)
        return None if wanted is None else self._held

    def _call(self, wanted: Preshape | None, time_us: int) -> None:
        """Note what this frame calls for, and change to it once it was called for long enough."""
        if wanted is not self._called:
            self._called, self._since_us = wanted, time_us
        if wanted is not None and time_us - self._since_us >= self._settle_us:
            self._held = wanted
