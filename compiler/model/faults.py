"""Inputs that fail: substitutes for lost ones, and the accuracy that remains under every fault.

A lost input's substitute is the constant row with which the others explain the recordings best. A mean row is an
input's average contribution. But the other inputs are often correlated with it, and their rows were learned with the
input present: without it, some grasp types become too probable on the whole and others not enough. So each input is
left out of the training rows, and its substitute changes until the summed probability of every type equals its
frequency: that is the maximum of the likelihood for a constant row. A step adds ln(frequency / sum of the
probabilities) to each type, which never lowers the likelihood (J. N. Darroch and D. Ratcliff, Ann. Math. Stat. 43,
1972).

Where a build has switches and joints, all inputs of one kind may be lost at once, and the sum of their substitutes is
used. Steps for single inputs leave a residual in that sum; least squares over both kinds of residuals say how to share
a step. Inputs whose contribution is constant take no part: another silent joint changes nothing for the others.

An entry stays between the input's smallest and largest contribution to its type, so no sum can leave its bounds. There
are few steps, because later ones overfit the training rows, above all where several inputs are lost.

The accuracy is counted from the integer tables, for every fault on every row. Scores are sums, so a fault changes one
term of each: a stuck input adds the row of the value at which it is stuck, a lost input its substitute row. Trials are
counted as correct by the majority of their frames.

Predictions need no sorting: with scores S_k, the largest value of S_k * K + (K - 1 - k) encodes in its remainder the
class with the largest score, the lowest number at a tie.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, islice, pairwise

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Faults, Faulty
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.scanning.scanmap import ScanMap

from ..elementary import Floats, log, softmax

Numbers = NDArray[np.intp]
Steps = NDArray[np.int64]
Scores = NDArray[np.int32]
Found = tuple[int, ...]

# Steps of all inputs kept in memory at a time, and additions beyond which pairs are skipped: some minutes.
_HELD, _MOST = 1 << 23, 1 << 37
# Steps from the mean rows; the number of distinct rows used.
STEPS, ROWS = 20, 1000
_BIT = ("open", "closed")
# A type without rows, or with probability zero, is neither impossible nor certain.
_DOUBT = 0.5


def fit_lost(
    tables: IntegerTables, bits: NDArray[np.bool_], codes: NDArray[np.uint16], labels: NDArray[np.intp]
) -> IntegerTables:
    """Return the tables with the substitutes for each lost switch and joint fitted to the training rows.

    Parameters
    ----------
    tables : IntegerTables
        Their mean rows are the starting point of the fit.
    bits : array of bool, shape (n, s)
        The kept switches.
    codes : array of uint16, shape (n, j)
        The codes of the kept joints.
    labels : array of int, shape (n,)
        The number of each row's class.
    """
    # Distinct rows, at most ROWS, and how often each occurs: the same rows for any row order.
    distinct = np.column_stack([labels, np.packbits(bits, axis=1), codes])
    _, rows, counts = np.unique(distinct, axis=0, return_index=True, return_counts=True)
    number = min(len(rows), ROWS)
    some = np.arange(number) * len(rows) // max(number, 1)
    rows, often = rows[some], counts[some].astype(np.float64)
    bits, codes, labels = bits[rows], codes[rows], labels[rows]
    wanted = np.asarray(np.bincount(labels, often, tables.n_classes) + _DOUBT, np.float64)
    switch_rows = tables.switch_rows.astype(np.int64)
    closed, joints = bits.astype(np.int64) @ switch_rows, tables.joint_sums(codes).astype(np.int64)
    whole = closed + joints
    ends, spans = zip(*((end[: tables.n_switches], end[tables.n_switches :]) for end in tables.ends), strict=True)
    # For each varying input, and then for all of its kind if the other kind varies: the scores without it.
    of_switches, of_joints = (np.flatnonzero((least != most).any(axis=1)) for least, most in (ends, spans))
    switches = [whole - bits[:, switch, np.newaxis] * switch_rows[switch] for switch in of_switches]
    each = [whole - joints + _without(tables, codes, [joint]) for joint in of_joints.tolist()]
    if switches and (joints != joints[0]).any():
        switches.append(joints)
    if each and (closed != closed[0]).any():
        each.append(closed + _without(tables, codes, range(tables.n_joints)))

    def fitted(
        means: NDArray[np.int16], chosen: NDArray[np.intp], others: Sequence[Steps], ends: tuple[Steps, ...]
    ) -> NDArray[np.int16]:
        found, before, lacks = means.astype(np.int64), list[Steps](), list[Floats]()
        for _ in range(STEPS if len(chosen) else 0):
            rows = [*found[chosen], found.sum(axis=0)][: len(others)]
            # A row that has not moved keeps its residual.
            lacks = [
                lacks[number]
                if before and np.array_equal(before[number], row)
                else _lack(others[number] + row, often, wanted, tables.scale)
                for number, row in enumerate(rows)
            ]
            before, steps = rows, np.array(lacks[: len(chosen)])
            if len(lacks) > len(chosen):
                steps += (lacks[-1] - steps.sum(axis=0)) / (1 + len(chosen))
            found[chosen] += np.rint(steps).astype(np.int64)
            found = np.clip(found, *ends)
        return found.astype(np.int16)

    return replace(
        tables,
        switch_means=fitted(tables.switch_means, of_switches, switches, ends),
        joint_means=fitted(tables.joint_means, of_joints, each, spans),
    )


def _without(tables: IntegerTables, codes: NDArray[np.uint16], joints: Sequence[int]) -> Steps:
    """Return bias plus joints without the given `joints`, (n, K): a lost joint of a grid reads as code 0."""
    left = codes.copy()
    left[:, list(joints)] = 0
    own = [tables.binned(joint).rows[0].astype(np.int64) for joint in joints]
    found: Steps = tables.joint_sums(left).astype(np.int64) - np.sum(own, axis=0)
    return found


def _lack(scores: Steps, often: Floats, wanted: Floats, scale: float) -> Floats:
    """Return the steps of score (K,) that each type lacks to reach its `wanted` probability."""
    shares = softmax(np.ascontiguousarray(scores.T / scale))
    # Summed in integer parts, few enough for an exact double: the order does not matter.
    parts = 2.0 ** min(32, 52 - int(wanted.sum()).bit_length())
    given = np.rint(shares * often * parts).sum(axis=1) / parts + _DOUBT
    return scale * log(wanted / given)


@dataclass(frozen=True, slots=True, eq=False)
class FaultCounts:
    """How many of `total` trials are correct: `correct` without a fault, and with each of these.

    lost   (inputs,) with each input lost, switches first; stuck: for each input (values,), stuck at each value
    dead   with each group of inputs lost together
    pairs  with two inputs lost, in the order of itertools.combinations; empty if there are too many
    values for each input, descriptions of its values
    """

    total: int
    correct: int
    lost: Found
    stuck: tuple[Found, ...]
    dead: Found
    pairs: Found
    values: tuple[tuple[str, ...], ...]


def count_faults(
    tables: IntegerTables,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    labels: Numbers,
    trials: Numbers,
    groups: Sequence[Sequence[int]] = (),
    progress: Callable[[int, int], None] | None = None,
) -> FaultCounts:
    """Count the trials that stay correct under each fault, for rows of all trials.

    Rows are kept switches (n, s), codes (n, j), labels and trials (n,). Labels outside the tables' classes are never
    correct. `groups` are indices of inputs that fail together, switches first, then joints.
    """
    terms = _terms(tables)
    joined = _joined(tables)
    bins = (np.searchsorted(_steps(tables, joint), codes[:, joint]) for joint in range(tables.n_joints))
    at = np.vstack([bits.T.astype(np.intp), *(column[np.newaxis] for column in bins)])
    order, trial = np.argsort(trials, kind="stable"), np.unique(np.sort(trials), return_inverse=True)[1]
    together = [(), *((element,) for element in range(len(terms))), *map(tuple, groups)]
    few = len(terms) ** 2 * len(labels) * tables.n_classes <= _MOST
    # Blocks of about as many rows as are kept at a time, which split no trial.
    size, starts = max(1, _HELD // (tables.n_classes * (len(terms) + 1))), np.flatnonzero(np.diff(trial, prepend=-1))
    cuts = [*starts[np.flatnonzero(np.diff(starts // size, prepend=-1))].tolist(), len(trial)]
    found = np.zeros(0, np.int64)
    for number, (first, end) in enumerate(pairwise(cuts), 1):
        rows = order[first:end]
        block = _Block(tables, terms, joined, at[:, rows], labels[rows], trial[first:end])
        counts = [*block.counts(together)]
        if few:
            kept = block.changeable()
            part = _Block(tables, terms, joined, at[:, rows[kept]], labels[rows[kept]], trial[first:end][kept])
            settled = counts[0] - part.right(part.whole)
            counts += [settled + right for right in part.pairs()]
        found = np.array(counts) + found if found.size else np.array(counts)
        if progress is not None:
            progress(number, len(cuts) - 1)
    ends = np.cumsum([1, len(terms), len(groups), *(len(term.rows) for term in terms)])
    (whole,), lost, dead, *stuck, pairs = (tuple(part.tolist()) for part in np.split(found, ends))
    return FaultCounts(int(trial[-1]) + 1, whole, lost, tuple(stuck), dead, pairs, tuple(term.values for term in terms))


@dataclass(frozen=True, slots=True, eq=False)
class _Term:
    """An input: the rows of its values, (values, K), its substitute row (K,), and descriptions of its values."""

    rows: Scores
    mean: Scores
    values: tuple[str, ...]


def _terms(tables: IntegerTables) -> list[_Term]:
    terms = [
        _Term(bit.of(np.arange(2)).astype(np.int32), mean, _BIT)
        for bit, mean in zip(tables.bits, tables.switch_means.astype(np.int32), strict=True)
    ]
    for joint, mean in enumerate(tables.joint_means.astype(np.int32)):
        steps = _steps(tables, joint)
        ends = [-1, *steps.tolist()]
        words = [f"codes {low + 1} to {high}" for low, high in pairwise(ends)]
        words.append(f"codes above {ends[-1]}" if len(ends) > 1 else "any code")
        rows = tables.binned(joint).of(np.append(0, steps + 1))
        terms.append(_Term(rows.astype(np.int32), mean, tuple(words)))
    return terms


def _steps(tables: IntegerTables, joint: int) -> Steps:
    """Return the last code of each interval of a joint in which its contribution is constant."""
    return np.union1d(tables.binned(joint).thresholds, tables.steps_of(joint)).astype(np.int64)


def _joined(tables: IntegerTables) -> dict[tuple[int, int], Scores]:
    """Return the contribution of pairs of inputs together, (values + 1, values + 1, K); the last value of each means
    lost.
    """
    found = {}
    for grid in tables.grids:
        codes = (np.concatenate([[0], _steps(tables, joint) + 1, [0]]) for joint in grid.joints)
        one, other = np.meshgrid(*codes, indexing="ij")
        rows = grid.of(one.ravel(), other.ravel()).reshape(*one.shape, -1)
        found[tables.n_switches + grid.joints[0], tables.n_switches + grid.joints[1]] = rows.astype(np.int32)
    return found


class _Block:
    """Rows of complete trials: `at` (inputs, n) is the value of each input; labels and trials (n,), ascending."""

    def __init__(
        self,
        tables: IntegerTables,
        terms: Sequence[_Term],
        joined: Mapping[tuple[int, int], Scores],
        at: Numbers,
        labels: Numbers,
        trials: Numbers,
    ) -> None:
        self._k = tables.n_classes
        self._labels, begins = labels, np.diff(trials, prepend=-1) > 0
        self._first, self._trial = np.flatnonzero(begins), np.cumsum(begins) - 1
        # One number per class: sums of 16 bits times K, under any faults.
        self._terms = [np.ascontiguousarray(term.rows.T * self._k) for term in terms]
        self._at = at
        bias = tables.bias.astype(np.int32) * self._k + np.arange(self._k, dtype=np.int32)[::-1]
        self.whole = bias[:, None].repeat(at.shape[1], 1)
        for rows, values in zip(self._terms, at, strict=True):
            self.whole += rows[:, values]
        self.lost = [
            (term.mean * self._k)[:, None] - rows[:, values]
            for term, rows, values in zip(terms, self._terms, at, strict=True)
        ]
        # For each paired input, the other one, and the rows of both with the axis of the former first.
        self._joined = {one: (other, rows) for (one, other), rows in joined.items()}
        self._joined |= {other: (one, rows.swapaxes(0, 1)) for (one, other), rows in joined.items()}
        # If both inputs of a pair are lost, the correction to the sum of their separate differences.
        self._both: dict[tuple[int, int], Scores] = {}
        for pair, rows in joined.items():
            now = self._added(pair[0], at[pair[0]])
            self.whole += now
            alone = [self._added(each, -1) - now for each in pair]
            self._both[pair] = (rows[-1, -1] * self._k)[:, None] - now - sum(alone)
            for each, more in zip(pair, alone, strict=True):
                self.lost[each] = self.lost[each] + more

    def _added(self, one: int, value: Numbers | int) -> Scores:
        """Return the contribution (K, n) of a paired input with this value in each row, together with its partner."""
        other, rows = self._joined[one]
        found: Scores = rows[value, self._at[other]].T * self._k
        return found

    def right(self, scores: Scores) -> int:
        """Return the number of trials that are correct with scores (K, n)."""
        found = self._k - 1 - scores.max(axis=0) % self._k
        if len(self._first) == len(self._labels):
            return int(np.count_nonzero(found == self._labels))
        counts = np.bincount(self._trial * self._k + found, minlength=len(self._first) * self._k)
        return int(np.count_nonzero(counts.reshape(-1, self._k).argmax(axis=1) == self._labels[self._first]))

    def counts(self, together: Sequence[Found]) -> Iterator[int]:
        """Yield the correct trials with each group of inputs lost, and with each input stuck at each value."""
        for group in together:
            both = (more for pair, more in self._both.items() if {*pair} <= {*group})
            yield self.right(sum(both, sum((self.lost[element] for element in group), self.whole)))
        for one, (rows, at) in enumerate(zip(self._terms, self._at, strict=True)):
            without, paired = self.whole - rows[:, at], one in self._joined
            if paired:
                without -= self._added(one, at)
            for value, row in enumerate(rows.T):
                more: Scores | int = self._added(one, value) if paired else 0
                yield self.right(without + row[:, None] + more)

    def pairs(self) -> Iterator[int]:
        """Yield the correct trials with each pair of inputs lost."""
        for one, lost in enumerate(self.lost):
            without = self.whole + lost
            for other, more in enumerate(self.lost[one + 1 :], one + 1):
                scores = without + more
                if (one, other) in self._both:
                    scores += self._both[one, other]
                yield self.right(scores)

    def changeable(self) -> Numbers:
        """Return all rows of the trials in which a row may be predicted otherwise with two inputs lost.

        The two losses that favour a class most, over the prediction, bound what any pair does.
        """
        winner, rows = self.whole.argmax(axis=0), np.arange(len(self._labels))
        most = second = joined = np.zeros_like(self.whole)
        for lost in self.lost:
            gained = lost - lost[winner, rows]
            most, second = np.maximum(most, gained), np.maximum(second, np.minimum(most, gained))
        for both in self._both.values():
            joined = np.maximum(joined, both - both[winner, rows])
        near = most + second + joined >= self.whole[winner, rows] - self.whole
        near[winner, rows] = False
        return np.flatnonzero(np.logical_or.reduceat(near.any(axis=0), self._first)[self._trial])


def groups_of(scan: ScanMap | None, sources: Sequence[str], n_joints: int) -> Mapping[str, Found]:
    """Return the inputs that fail together, by the name of the common part.

    Parts are taxels of several levels; ports, chips and boards of the scan map, counted from 1 as in the harness; and
    the device that reads the joints.

    sources  for each kept switch its name, or that of the taxel whose level it is
    """
    found: dict[str, Found] = {}
    for taxel, levels in Counter(sources).items():
        if levels > 1:
            found[f"taxel {taxel}"] = tuple(one for one, source in enumerate(sources) if source == taxel)
    for port in () if scan is None else scan.ports:
        chip = f"chip {port.chip + 1} of bus {port.bus + 1}"
        found[f"port {port.reading} of {chip}"] = port.elements
        found[chip] = found.get(chip, ()) + port.elements
    for number, stream in enumerate(() if scan is None else scan.streams):
        if own := tuple(pair[-1] for pair in (*stream.switches, *stream.levels)):
            found[f"stream {number + 1}"] = own
    if n_joints:
        found["the joints' device"] = tuple(range(len(sources), len(sources) + n_joints))
    return found


def worst_faults(counts: FaultCounts, names: Sequence[str], groups: Mapping[str, Found]) -> Faults:
    """Return the worst fault of each kind, the first of equal ones; `names` are those of the inputs."""
    lost = [Faulty("lost", (name,), left) for name, left in zip(names, counts.lost, strict=True)]
    stuck = [
        Faulty(f"stuck {'' if value in _BIT else 'at '}{value}", (name,), left)
        for name, found, values in zip(names, counts.stuck, counts.values, strict=True)
        for left, value in zip(found, values, strict=True)
    ]
    dead = [
        Faulty(f"lost with {what}", tuple(names[one] for one in group), left)
        for (what, group), left in zip(groups.items(), counts.dead, strict=True)
    ]
    pair = []
    if counts.pairs:
        worst = int(np.argmin(counts.pairs))
        both = next(islice(combinations(names, 2), worst, None))
        pair = [Faulty("both lost", both, counts.pairs[worst])]
    kinds = (min(faults, key=lambda fault: fault.correct, default=None) for faults in (lost, stuck, dead, pair))
    return Faults(counts.total, counts.correct, *kinds)
