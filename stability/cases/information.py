"""Entropy, information gain, and the choice of the best input, for counts beyond 10^9."""

from collections.abc import Iterator

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.placement.gain import Cooccurrence, NodeCounts, best_position, compare, entropy_bits, gain_bits

from ..checks.rounds import ROUNDING, part_of
from ..finding import REFERENCE, Finding
from ..reference import information as truth
from ..reference.numbers import precisely

WHOLE_NUMBERS = "products of whole numbers"

Counts = NDArray[np.int64]
BitSet = tuple[NDArray[np.bool_], NDArray[np.intp], int]  # X (n, d), labels (n,), number of classes
Pair = tuple[int, int | None]  # a bit, and the bit given


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of gains and entropies, and the number of wrong choices between inputs."""
    rng, more = np.random.default_rng(2), 10 if full else 1
    tables = [*hand_made(), *(random_table(rng) for _ in range(150 * more))]
    yield gains_of(tables)
    yield entropies_of(tables)
    pairs = [*equal_pairs(), *close_pairs(rng, 60 * more)]
    yield comparisons_of(pairs)
    yield choices_of(pairs)
    bits = [bit_set(rng) for _ in range(4 * more)]
    yield given_of(bits)
    yield given_comparisons_of(bits, rng)


def random_table(rng: np.random.Generator) -> Counts:
    """Return counts of all magnitudes up to 10^9, some of them 0."""
    shape = int(rng.integers(2, 15)), int(rng.integers(2, 5))
    counts = np.floor(10.0 ** rng.uniform(-1, 9, shape)).astype(np.int64)
    counts[0, 0] += 1
    return counts


def node_of(*tables: Counts) -> NodeCounts:
    """Return the node at which inputs have these tables (K, values), each of the same classes."""
    cells = np.concatenate([table[:, 1:] for table in tables], axis=1)
    starts = np.cumsum([0] + [table.shape[1] - 1 for table in tables])[:-1]
    return NodeCounts(tables[0].sum(axis=1), cells, starts)


def hand_made() -> Iterator[Counts]:
    """Yield tables close to independence, close to certainty, and with one row in 10^9."""
    for m in (1, 10, 10**3, 10**6, 10**9):
        yield np.array([[m + 1, m - 1], [m, m]])
        yield np.array([[m, 0], [0, m]])
        yield np.array([[m, 1], [1, m]])
        yield np.array([[m, 0], [m, 1]])
        yield np.array([[m, m], [m, m]])


def equal_pairs() -> Iterator[tuple[Counts, Counts]]:
    """Yield tables of equal gains with different terms."""
    for one, other in (
        ([[8, 0], [4, 4]], [[7, 1], [2, 6]]),
        ([[6, 0], [3, 3], [3, 3]], [[5, 1], [4, 2], [1, 5]]),
        ([[12, 0], [6, 6]], [[12, 0, 0], [6, 6, 0]]),
    ):
        for factor in (1, 10**3, 10**8):
            yield np.array(one) * factor, np.array(other) * factor


def close_pairs(rng: np.random.Generator, n: int) -> Iterator[tuple[Counts, Counts]]:
    """Yield tables of up to 10^9 rows a cell and the same class counts that differ by the cell of one row."""
    for _ in range(n):
        one = rng.integers(1, 10 ** int(rng.integers(1, 10)) + 1, (3, 2))
        other = one[:, ::-1].copy()
        if rng.random() < 0.8:
            row, moved = int(rng.integers(3)), int(rng.choice([-1, 1]))
            moved = min(max(moved, -int(other[row, 0])), int(other[row, 1]))
            other[row] += (moved, -moved)
        yield one, other


def bit_set(rng: np.random.Generator) -> BitSet:
    """Return 7 bits, some of them equal, opposite, constant and almost constant, of 2 to 8 classes."""
    n, classes = int(rng.integers(30, 3000)), int(rng.integers(2, 9))
    labels = rng.integers(0, classes, n)
    one, other = rng.random(n) < 0.3 + 0.1 * labels % 0.7, rng.random(n) < 0.5
    rare = np.arange(n) == n // 2
    return np.column_stack([one, ~one, one, other, one ^ other, rare, np.ones(n, bool)]), labels, classes


def gains_of(tables: list[Counts]) -> Finding:
    """Compare gains of tables (K, values) with the reference."""
    worst = Finding.of("gain", REFERENCE, 1.0, "x rounding")
    for table in tables:
        counts = [*table.ravel().tolist(), *table.sum(axis=0).tolist(), *table.sum(axis=1).tolist()]
        _see(worst, gain_bits(table), truth.gain_bits(table.tolist()), counts, int(table.sum()))
    return worst


def entropies_of(tables: list[Counts]) -> Finding:
    """Compare entropies of the classes of tables (K, values) with the reference."""
    worst = Finding.of("entropy", REFERENCE, 1.0, "x rounding")
    for table in tables:
        totals = table.sum(axis=1).tolist()
        _see(worst, entropy_bits(totals), truth.entropy_bits(totals), totals, sum(totals))
    return worst


@precisely()
def _see(worst: Finding, got: float, exact: mpf, counts: list[int], n: int) -> None:
    """Add the error of a sum of terms m ln m of `counts` and of all n rows.

    A term is off by 5 roundings: a logarithm within 2 ulp counts for 4, the product for one. They are summed exactly
    and rounded once, and divided by n ln 2, a product of a constant: 4 roundings of the sum itself.
    """
    allowed = ROUNDING * (5 * _n_log_n([*counts, n]) / (n * mpmath.log(2)) + 4 * exact)
    worst.see(part_of(got, exact, allowed), f"of {n} rows")


def _n_log_n(counts: list[int]) -> mpf:
    return mpmath.fsum(m * mpmath.log(m) for m in counts if m)


def comparisons_of(pairs: list[tuple[Counts, Counts]]) -> Finding:
    """Count wrong comparisons of two gains."""
    worst = Finding.of("which of two gains is greater", WHOLE_NUMBERS, 0.0, "choices")
    wrong = [
        compare(a, a.sum(axis=0), b, b.sum(axis=0)) != truth.compare_gains(a.tolist(), b.tolist()) for a, b in pairs
    ]
    worst.see(float(sum(wrong)), tried=len(pairs))
    return worst


def choices_of(pairs: list[tuple[Counts, Counts]]) -> Finding:
    """Count wrong choices of the best of three inputs, in any order; of equal ones the lowest must win."""
    worst = Finding.of("which input is kept", WHOLE_NUMBERS, 0.0, "choices")
    wrong = 0
    for one, other in pairs:
        for tables in ((one, other, one), (other, one, other)):
            greater = truth.compare_gains(tables[1].tolist(), tables[0].tolist()) > 0
            wrong += best_position(node_of(*tables), np.arange(3)) != int(greater)
            wrong += best_position(node_of(*tables), np.array([2, 1, 0])) != (1 if greater else 2)
    worst.see(float(wrong), tried=4 * len(pairs))
    return worst


def _tables(X: NDArray[np.bool_], labels: NDArray[np.intp], bit: int, given: int | None) -> list[truth.Table]:
    """Return the counts (K, 2) of classes at the values of `bit`, one table for each value of the given bit."""
    condition = np.zeros(len(X), bool) if given is None else X[:, given]
    classes = range(int(labels.max()) + 1)
    return [
        [[int(((labels == c) & (X[:, bit] == v) & (condition == g)).sum()) for v in (False, True)] for c in classes]
        for g in (False, True)
    ]


def given_of(sets: list[BitSet]) -> Finding:
    """Compare the information of bits about the class, alone and given another bit, with the reference."""
    worst = Finding.of("information of a bit, given another", REFERENCE, 1.0, "x rounding")
    for X, labels, classes in sets:
        counted = Cooccurrence(X, labels, classes)
        for given in (None, 0, 3):
            for bit, got in enumerate(counted.information(given).tolist()):
                tables = _tables(X, labels, bit, given)
                gain = truth.conditional_gain_bits(tables)
                with precisely():
                    nats = gain * len(X) * mpmath.log(2)
                    worst.see(part_of(got, nats, _given_error(tables)), f"{len(X)} rows, {classes} classes")
    return worst


def _given_error(tables: list[truth.Table]) -> mpf:
    """Bound the error of n I(class; bit | given), of four sums of terms m ln m.

    A term is off by 9 roundings, 8 of them for a logarithm within 4 ulp, whichever numpy has; a sum of T rounds T - 1
    times, and its three additions to the others once each.
    """
    cells = [m for table in tables for row in table for m in row]
    columns = [sum(column) for table in tables for column in zip(*table, strict=True)]
    rows = [sum(row) for table in tables for row in table]
    totals = [sum(map(sum, table)) for table in tables]
    return ROUNDING * mpmath.fsum((len(counts) + 11) * _n_log_n(counts) for counts in (cells, columns, rows, totals))


def given_comparisons_of(sets: list[BitSet], rng: np.random.Generator) -> Finding:
    """Count wrong comparisons of the information of two bits, both alone or given another."""
    worst = Finding.of("which of two bits is more informative, given others", WHOLE_NUMBERS, 0.0, "choices")
    for X, labels, classes in sets:
        counted = Cooccurrence(X, labels, classes)
        wrong = 0
        # The first three pairs are equally informative, with reordered terms: opposites, and one bit xor another.
        pairs: list[Pair] = [(0, None), (0, None), (0, 3), *_pairs(rng, X.shape[1])]
        others: list[Pair] = [(1, None), (2, None), (4, 3), *_pairs(rng, X.shape[1])]
        for one, other in zip(pairs, others, strict=True):
            sign = truth.compare_conditional_gains(_tables(X, labels, *one), _tables(X, labels, *other))
            wrong += counted.sign(one, other) != sign
        worst.see(float(wrong), tried=len(pairs))
    return worst


def _pairs(rng: np.random.Generator, bits: int) -> Iterator[Pair]:
    for bit, given in rng.integers(0, [bits, bits + 1], (9, 2)).tolist():
        yield bit, None if given == bits else given
