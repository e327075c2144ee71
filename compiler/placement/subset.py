"""How far a placement of m switches is from the best there is: a bounded search.

The objective is the number of pairs of grasps of different types that look alike, equal in every kept switch: no
classifier tells these apart. It says nothing of what a given classifier makes of the rest; but unlike a recognition
rate it can be bounded over all subsets of m switches. Every switch that is added tells fewer new pairs apart than it
would have before (the number told apart is submodular), so for every set S, be it good or bad, and every T

    alike(T) >= alike(S) - sum over a in T of gain(a | S)         (Nemhauser, Wolsey, Math. Programming 14, 1978)

One such line for each of many S makes an integer program in one variable a switch, whose optimum is a bound; its answer
is a subset that is evaluated, and gives the next lines. Where bound and best subset meet, the subset is proved best.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from ..samples import Columns, Samples
from .bounding import Bounding
from .errors import PlacementError
from .exchange import filled, swapped
from .pairs import Pairs


@dataclass(frozen=True, slots=True)
class Subset:
    """The best subset of m switches that was found, as numbers of pairs of rows of different types that look alike.

    columns  in the order of what they bring, the next best one first
    pairs    pairs there are
    alike    pairs that look alike in `columns`
    least    no subset of so many switches leaves fewer
    nodes    integer programs that were solved
    """

    columns: Columns
    pairs: int
    alike: int
    least: int
    nodes: int

    @property
    def value(self) -> float:
        """Return the share of the pairs that `columns` tell apart."""
        return self.share_apart(self.alike)

    @property
    def bound(self) -> float:
        """Return the share of the pairs that no subset of so many switches exceeds."""
        return self.share_apart(self.least)

    @property
    def gap(self) -> float:
        """Return how much better, at most, the best subset is: a share of all pairs."""
        return self.bound - self.value

    @property
    def proved(self) -> bool:
        """Return whether no subset is better."""
        return self.alike <= self.least

    def share_apart(self, alike: int) -> float:
        """Return the share of the pairs told apart where so many look alike; 1 if there are none."""
        return 1.0 - alike / self.pairs if self.pairs else 1.0


def best_subset(
    learning: Samples,
    m: int,
    *,
    rounds: int = 10,
    starts: tuple[Columns, ...] = (),
    on_round: Callable[[int, int], None] | None = None,
) -> Subset:
    """Return the best subset of m switches that `rounds` integer programs find, and a bound on all others.

    starts    placements of at most m switches to start from besides the greedy one: the answer is no worse than they
    on_round  is called with (done, rounds) after every integer program

    The objective is that of this module. Raises PlacementError if m or rounds is negative.
    """
    if m < 0 or rounds < 0:
        raise PlacementError(f"m = {m} and rounds = {rounds} must be at least 0")
    pairs = Pairs(learning)
    search = _Search(pairs, min(m, len(pairs.varying)))
    for start in dict.fromkeys([(), *(start[: search.m] for start in starts)]):
        search.offer(swapped(pairs, filled(pairs, start, search.m)))
    nodes = 0
    while nodes < rounds and search.open:
        search.step()
        nodes += 1
        if on_round is not None:
            on_round(nodes, rounds)
    order = filled(pairs, (), search.m, among=search.best)
    return Subset(order, pairs.total, search.alike, search.least, nodes)


@dataclass(slots=True)
class _Search:
    """The best subset of m so far, which leaves `alike` pairs alike, and `least`, below which none can get."""

    pairs: Pairs
    m: int
    bounding: Bounding = field(init=False)
    best: Columns = ()
    alike: int = field(init=False)
    least: int = field(init=False)
    stuck: bool = False
    _seen: set[frozenset[int]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.bounding = Bounding(self.pairs.varying, self.pairs.total, self.m)
        self.alike = self.pairs.total
        everything: Columns = tuple(self.pairs.varying.tolist())
        self.least = self.pairs.alike(everything) if self.m else self.alike

    @property
    def open(self) -> bool:
        """Whether anything is left to look for: not proved yet, and the last integer program told something new."""
        return self.least < self.alike and not self.stuck

    def offer(self, columns: Columns) -> bool:
        """Take a subset of m, and the lines it gives; return whether it was a new one."""
        if frozenset(columns) in self._seen:
            return False
        self._seen.add(frozenset(columns))
        if (alike := self.pairs.alike(columns)) <= self.alike:
            self.best, self.alike = columns, alike
        for part in _parts(columns):
            self.bounding.add(self.pairs.alike(part), self.pairs.gains(part))
        return True

    def step(self) -> None:
        """Solve one integer program, and evaluate its answer."""
        least, columns = self.bounding.solve()
        self.least = min(max(self.least, least), self.alike)
        self.stuck = len(columns) != self.m or not self.offer(columns)


def _parts(columns: Columns) -> Iterator[Columns]:
    """Yield the sets whose lines are of use about `columns`: itself, all but one of it, and its beginnings."""
    yield columns
    for place in range(len(columns)):
        yield columns[:place] + columns[place + 1 :]
        yield columns[:place]
