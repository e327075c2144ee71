"""Who stands where in one frame, and what of it holds whatever the switches that were left unread may be."""

from operator import add

from ..scanning.reach import Reach
from ..softmax import softmax
from .frames import Mask


class Standing:
    """The K scores of a frame (2^15 too high, unread switches left out), and what unread switches could do to them.

    Without unread switches every number here is that of the frame. With some, `margin`, `lead` and `probability` are
    the least that any state of the unread switches, closed, open or lost, would have given: the true ones are no less.
    """

    __slots__ = ("_reach", "_rivals", "_unread", "candidate", "lanes")

    def __init__(self, lanes: tuple[int, ...], reach: Reach, unread: Mask = 0) -> None:
        self.lanes = lanes
        self.candidate = lanes.index(max(lanes))
        self._reach, self._unread = reach, unread
        self._rivals = self._nearest(self.candidate)

    @property
    def certain(self) -> bool:
        """Whether the candidate wins whatever the unread switches are; of equal scores the lowest number wins."""
        return self._rivals.index(max(self._rivals)) == self.candidate

    @property
    def margin(self) -> int:
        """How many steps the candidate leads the second best by."""
        second, best = sorted(self._rivals)[-2:]
        return best - second

    def lead(self, held: int) -> int:
        """Return how many steps the candidate leads class `held` by."""
        return self.lanes[self.candidate] - self._rivals[held]

    def contradicts(self, held: int, lead: int) -> bool:
        """Return whether the candidate is not `held` and leads it by `lead` steps, as far as may be: with unread
        switches, whether any state of them gives that lead.
        """
        if self.candidate == held:
            return False
        most = self._reach.of(held, self._unread)[self.candidate] if self._unread else 0
        return self.lanes[self.candidate] - self.lanes[held] + most >= lead

    def probability(self, number: int, scale: float) -> float:
        """Return the softmax of class `number`, at `scale` steps per unit."""
        return softmax(self._rivals if number == self.candidate else self._nearest(number), number, scale)

    def _nearest(self, number: int) -> tuple[int, ...]:
        """Return the scores with every rival of class `number` as near to it, or as far above it, as it can come."""
        if not self._unread:
            return self.lanes
        return tuple(map(add, self.lanes, self._reach.of(number, self._unread)))
