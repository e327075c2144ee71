"""A bounded search for the best placement of m switches, and the gap between it and a given placement.

The objective is the number of pairs of grasps of different types that look alike, equal in every kept switch: no
classifier can distinguish them. It does not predict a given classifier's accuracy; but unlike accuracy it can be
bounded over all subsets of m switches. The number of distinguished pairs is submodular: the more switches there are,
the fewer new pairs another one distinguishes. So for every set S, good or bad, and every T

    alike(T) >= alike(S) - sum over a in T of gain(a | S)         (Nemhauser, Wolsey, Math. Programming 14, 1978)

One such cut for each of many S makes an integer program with one variable per switch, whose optimum is a bound. Its
solution is a subset, which is evaluated and gives the next cuts. When bound and best subset meet, the subset is proved
best.
"""

import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..samples import Columns, Samples
from .constraints import Bound
from .exact import Counts
from .inputs import PlacementError

Numbers = NDArray[np.intp]

# The program is scaled so that a thousandth of all pairs is 1; HiGHS satisfies constraints to 1e-6 of that.
_UNIT, _SLACK = 1000.0, 1e-5
# Branch-and-bound nodes for one program. The remaining nodes still have a bound; a time limit would not be repeatable.
_NODES = 1000


@dataclass(frozen=True, slots=True)
class Subset:
    """The best subset of m switches that was found, as numbers of pairs of rows of different types that look alike.

    columns  in greedy order, the most informative one first
    pairs    all pairs
    alike    pairs that look alike in `columns`
    least    lower bound on the pairs alike in any subset of this size
    nodes    integer programs that were solved
    """

    columns: Columns
    pairs: int
    alike: int
    least: int
    nodes: int

    @property
    def proved(self) -> bool:
        """Whether no subset is better."""
        return self.alike <= self.least


def best_subset(
    samples: Samples,
    m: int,
    *,
    rounds: int = 10,
    starts: tuple[Columns, ...] = (),
    on_round: Callable[[int, int], None] | None = None,
    limits: Bound | None = None,
) -> Subset:
    """Return the best subset of m switches that `rounds` integer programs find, and a bound on all others.

    With `limits` the subsets are those of at most m switches that obey them, as none of m may.

    starts    placements of at most m switches to start from, in addition to the greedy one: the result is no worse
    on_round  is called with (done, rounds) after every integer program

    The module's docstring has the objective. Raises PlacementError if m or rounds is negative.
    """
    if m < 0 or rounds < 0:
        raise PlacementError(f"m = {m} and rounds = {rounds} must be at least 0")
    pairs = Pairs(samples)
    search = _Search(pairs, min(m, len(pairs.varying)) if limits is None else m, limits)
    first = () if limits is None else limits.obeyed((), m)
    for start in dict.fromkeys([first, *(start[: search.m] for start in starts)]):
        search.offer(swapped(pairs, filled(pairs, start, search.m, limits), limits))
    nodes = 0
    while nodes < rounds and search.open:
        search.step()
        nodes += 1
        if on_round is not None:
            on_round(nodes, rounds)
    order = filled(pairs, (), len(search.best), among=search.best)
    return Subset(order, pairs.total, search.alike, search.least, nodes)


class Pairs:
    """The pairs of rows of different grasp types, and how many of them look alike in some of the switches.

    Two rows look alike in some switches if they are equal in every one of these. All counts are exact integers.
    Joints are ignored.

    total      all pairs
    varying    (v,) numbers of the switches that are not constant
    """

    def __init__(self, samples: Samples) -> None:
        bits = samples.switches
        self.varying: Numbers = np.flatnonzero(bits.any(axis=0) & ~bits.all(axis=0))
        packed = np.packbits(bits[:, self.varying], axis=1)
        kinds = _numbered(packed) * samples.n_classes + samples.labels
        # Identical rows of one type become one row with a multiplicity.
        _, first, counts = np.unique(kinds, return_index=True, return_counts=True)
        self._bits, self._labels, self._counts = bits[first], samples.labels[first], counts.astype(np.float64)
        self._n_classes = samples.n_classes
        self.total = self.alike(())

    def alike(self, columns: Columns) -> int:
        """Return how many pairs look alike in `columns`."""
        groups, cells = self._cut(columns)
        return (_squares(np.bincount(groups, self._counts)) - _squares(np.bincount(cells, self._counts))) // 2

    def gains(self, columns: Columns) -> Counts:
        """Return (s,) how many of the pairs alike in `columns` each further switch, alone, distinguishes."""
        groups, cells = self._cut(columns)
        mixed = np.bincount(groups, self._counts)[groups] > np.bincount(cells, self._counts)[cells]
        left = self._halves(groups, mixed) - self._halves(cells, mixed)
        return np.asarray(self.alike(columns) - left // 2, dtype=np.int64)

    def _cut(self, columns: Columns) -> tuple[Numbers, Numbers]:
        """Return each row's group (rows alike in `columns`) and cell (the group's rows of one type), as numbers."""
        groups = _numbered(np.packbits(self._bits[:, list(columns)], axis=1))
        cells = np.unique(groups * self._n_classes + self._labels, return_inverse=True)[1]
        return groups, cells

    def _halves(self, parts: Numbers, rows: NDArray[np.bool_]) -> Counts:
        """Return for every switch (s,) the sum of squared sizes of the two halves into which it splits each part."""
        from scipy.sparse import csr_matrix

        numbers = np.unique(parts[rows], return_inverse=True)[1]
        shape = (int(numbers.max(initial=-1)) + 1, len(numbers))
        sums = csr_matrix((self._counts[rows], (numbers, np.arange(len(numbers)))), shape=shape)
        closed = sums @ self._bits[rows].astype(np.float64)
        opened = sums.sum(axis=1) - closed
        squares: NDArray[np.float64] = (np.square(closed) + np.square(opened)).sum(axis=0)
        return np.asarray(squares).ravel().astype(np.int64)


def _numbered(packed: NDArray[np.uint8]) -> Numbers:
    """Return for every row (n,) the number of its pattern."""
    if not packed.shape[1]:
        return np.zeros(len(packed), dtype=np.intp)
    return np.asarray(np.unique(packed, axis=0, return_inverse=True)[1], dtype=np.intp).ravel()


def _squares(sizes: NDArray[np.generic]) -> int:
    return int(np.square(sizes.astype(np.int64)).sum())


def filled(
    pairs: Pairs, columns: Columns, m: int, limits: Bound | None = None, among: Columns | None = None
) -> Columns:
    """Extend `columns` greedily, each time by the switch that distinguishes most further pairs, until there are m.

    With `limits` there may be fewer: a switch is taken if it breaks none of them and distinguishes at least one pair.

    among  candidates (None: every switch that varies); there must be enough. Ties go to the lowest number.
    """
    allowed = pairs.varying if among is None else np.array(sorted(among), dtype=np.intp)
    while len(columns) < m:
        open_ones = allowed[~np.isin(allowed, columns)]
        if limits is not None:
            open_ones = open_ones[limits.addable(columns)[open_ones]]
        gains = pairs.gains(columns)[open_ones]
        if limits is not None and not gains.any():
            break
        columns = (*columns, int(open_ones[gains.argmax()]))
    return columns


def swapped(pairs: Pairs, columns: Columns, limits: Bound | None = None) -> Columns:
    """Return `columns` after exchanging switches one by one, until no exchange leaves fewer pairs alike.

    With `limits`, switches that must be kept stay.
    """
    least = pairs.alike(columns)
    place = tried = 0
    while tried < len(columns):
        rest = columns[:place] + columns[place + 1 :]
        tried += 1
        if limits is None or limits.whole(rest):
            other = filled(pairs, rest, len(columns), limits)
            if (found := pairs.alike(other)) < least:
                columns, least, tried = other, found, 0
        place = (place + 1) % len(columns)
    return columns


class Bounding:
    """Cuts  alike(T) >= alike - sum over a in T of gains[a]  that hold for every T of m of the `varying` switches.

    With limits, T are the sets of at most m switches that obey them, and `varying` includes those that must be kept.
    """

    def __init__(self, varying: NDArray[np.intp], total: int, m: int, limits: Bound | None = None) -> None:
        self._varying, self._total, self._m, self._limits = varying, max(total, 1), m, limits
        self._gains: list[NDArray[np.floating]] = []
        self._alike: list[float] = []

    def add(self, alike: int, gains: Counts) -> None:
        """Add the cut of a set that leaves `alike` pairs, of which each switch (s,) distinguishes gains[a]."""
        self._gains.append(gains[self._varying] * (_UNIT / self._total))
        self._alike.append(alike * (_UNIT / self._total))

    def solve(self) -> tuple[int, Columns]:
        """Return a lower bound on the pairs alike in any m switches, and the m switches that minimise the cuts.

        The switches are empty if the node limit is reached before any are found.
        """
        from scipy.optimize import Bounds, LinearConstraint, milp

        v = len(self._varying)
        # One variable per switch, one for the bound, and one for each taxel and port that the limits count.
        rows, most = (np.zeros((0, v)), np.zeros(0)) if self._limits is None else self._limits.rows(self._varying)
        extra = rows.shape[1] - v
        lines = np.column_stack([np.array(self._gains), np.zeros((len(self._gains), extra)), np.ones(len(self._gains))])
        whole = np.append(np.ones(v + extra), 0.0)
        size = np.append(np.ones(v), np.zeros(extra + 1))
        fewest = self._m if self._limits is None else 0
        constraints = [
            LinearConstraint(lines, lb=np.array(self._alike)),
            LinearConstraint(size[np.newaxis], lb=fewest, ub=self._m),
        ]
        if len(rows):
            constraints.append(LinearConstraint(np.column_stack([rows, np.zeros(len(rows))]), ub=most))
        with _silent():
            found = milp(
                np.append(np.zeros(v + extra), 1.0),
                constraints=constraints,
                integrality=whole,
                bounds=Bounds(0.0, np.append(np.ones(v + extra), _UNIT)),
                options={"node_limit": _NODES, "mip_rel_gap": 0.0},
            )
        columns = () if found.x is None else tuple(self._varying[found.x[:v] > 0.5].tolist())
        bound = found.mip_dual_bound
        least = 0 if bound is None or not math.isfinite(bound) else math.ceil((bound - _SLACK) * self._total / _UNIT)
        return max(least, 0), columns


@contextmanager
def _silent() -> Iterator[None]:
    """Redirect stdout: HiGHS prints there from C even when silenced."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "wb") as nothing:  # noqa: PTH123 - a device, not a file of the user
        os.dup2(nothing.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


@dataclass(slots=True)
class _Search:
    """The best subset of m so far, which leaves `alike` pairs alike, and `least`, a lower bound for all."""

    pairs: Pairs
    m: int
    limits: Bound | None = None
    bounding: Bounding = field(init=False)
    best: Columns = ()
    alike: int = field(init=False)
    least: int = field(init=False)
    stuck: bool = False
    _seen: set[frozenset[int]] = field(default_factory=set)

    def __post_init__(self) -> None:
        varying = self.pairs.varying
        if self.limits is not None:
            varying = np.union1d(varying, np.array([one for group in self.limits.groups for one in group], np.intp))
        self.bounding = Bounding(varying, self.pairs.total, self.m, self.limits)
        self.alike = self.pairs.total
        everything: Columns = tuple(self.pairs.varying.tolist())
        self.least = self.pairs.alike(everything) if self.m else self.alike

    @property
    def open(self) -> bool:
        """Whether to go on: not proved yet, and the last integer program gave a new subset."""
        return self.least < self.alike and not self.stuck

    def offer(self, columns: Columns) -> bool:
        """Evaluate a subset of m and add its cuts; return whether it was new."""
        if frozenset(columns) in self._seen:
            return False
        self._seen.add(frozenset(columns))
        if (alike := self.pairs.alike(columns)) <= self.alike:
            self.best, self.alike = columns, alike
        for part in _parts(columns):
            self.bounding.add(self.pairs.alike(part), self.pairs.gains(part))
        return True

    def step(self) -> None:
        """Solve one integer program, and evaluate its solution."""
        least, columns = self.bounding.solve()
        self.least = min(max(self.least, least), self.alike)
        if self.limits is not None and not self.limits.holds(columns):
            columns = ()  # none was found
        self.stuck = (len(columns) != self.m and self.limits is None) or not self.offer(columns)


def _parts(columns: Columns) -> Iterator[Columns]:
    """Yield the sets whose cuts are useful near `columns`: itself, all but one of it, and its prefixes."""
    yield columns
    for place in range(len(columns)):
        yield columns[:place] + columns[place + 1 :]
        yield columns[:place]
