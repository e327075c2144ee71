"""Additive models as terms, with scores in floating point."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from .terms.base import CoreTerm, Floats, Rows, Term
from .terms.bins import Bins
from .terms.bit import Bit
from .terms.grid import Grid
from .terms.line import Line

# Scores closer than this are tied. Equal scores that are reached by different sums differ by some 1e-14; different
# settings of Weka differ by 1e-10 without a reason in the data.
TIE = 1e-9


@dataclass(frozen=True, eq=False)
class Additive(ABC):
    """A sum of terms: of bias (K,), of a `Bit` for each switch and `Bins` for each joint, both in order, and of further
    terms.
    """

    bias: Rows
    terms: tuple[Term, ...]

    _arguments: ClassVar[tuple[str, ...]] = ("bias", "switch_rows", "thresholds", "joint_rows", "further")

    @classmethod
    @abstractmethod
    def of(cls, *arrays: Any) -> Self:
        """Return tables of arrays, and of further terms."""

    def changed(self, **arguments: Any) -> Self:
        """Return the tables with other arguments of `of`."""
        return self.of(**{name: getattr(self, name) for name in self._arguments} | arguments)

    @property
    def n_classes(self) -> int:
        """K."""
        return len(self.bias)

    @cached_property
    def bits(self) -> tuple[Bit, ...]:
        """The term of each switch."""
        return tuple(term for term in self.terms if isinstance(term, Bit))

    @cached_property
    def bins(self) -> tuple[Bins, ...]:
        """The bins of each joint."""
        return tuple(term for term in self.terms if isinstance(term, Bins))

    @cached_property
    def further(self) -> tuple[Term, ...]:
        """All other terms."""
        return tuple(term for term in self.terms if not isinstance(term, Bit | Bins))

    @cached_property
    def core_terms(self) -> tuple[CoreTerm, ...]:
        """All terms.

        Raises ValueError where one is of another kind than the four: `collapse` returns tables without such.
        """
        terms = tuple(term for term in self.terms if isinstance(term, CoreTerm))
        if len(terms) < len(self.terms):
            raise ValueError("the tables have terms of other kinds: collapse them first")
        return terms

    @cached_property
    def grids(self) -> tuple[Grid, ...]:
        """The terms of two joints together."""
        return tuple(term for term in self.terms if isinstance(term, Grid))

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """The terms in proportion to a code."""
        return tuple(term for term in self.terms if isinstance(term, Line))

    @property
    def n_switches(self) -> int:
        """Number of kept switches, s."""
        return len(self.bits)

    @property
    def n_inputs(self) -> int:
        """Number of kept switches and joints."""
        return self.n_switches + self.n_joints

    @property
    def n_joints(self) -> int:
        """Number of joints, j."""
        return len(self.bins)

    @cached_property
    def switch_rows(self) -> Rows:
        """The contribution of each closed switch, (s, K)."""
        rows: Rows = np.array([bit.row for bit in self.bits], self.bias.dtype).reshape(-1, self.n_classes)
        return rows

    @property
    def thresholds(self) -> tuple[NDArray[np.uint16], ...]:
        """The thresholds (T_a,) of each joint."""
        return tuple(bins.thresholds for bins in self.bins)

    @property
    def joint_rows(self) -> tuple[Rows, ...]:
        """The rows (T_a + 1, K) of each joint's bins."""
        return tuple(bins.rows for bins in self.bins)

    def values(self, term: Term, bits: NDArray[np.bool_], codes: NDArray[Any]) -> list[NDArray[Any]]:
        """Return the values (n,) of a term's inputs in frames of switches (n, s) and codes (n, j)."""
        frames = bits if isinstance(term, Bit) else codes
        return [frames[:, number] for number in term.inputs]

    def steps_of(self, joint: int) -> NDArray[np.int64]:
        """Return the codes after which a joint's bins or grids change, in order."""
        steps = (
            steps
            for term in (*self.bins, *self.grids)
            for number, steps in zip(term.inputs, term.steps, strict=True)
            if number == joint
        )
        return np.unique(np.concatenate([*steps])).astype(np.int64)


def terms_of(
    switch_rows: Rows, thresholds: Sequence[NDArray[np.uint16]], joint_rows: Sequence[Rows]
) -> Iterator[Bit | Bins]:
    """Yield the terms of switches and joints."""
    for switch, row in enumerate(switch_rows):
        yield Bit(switch, row)
    for joint, (steps, rows) in enumerate(zip(thresholds, joint_rows, strict=True)):
        yield Bins(joint, steps, rows)


@dataclass(frozen=True, eq=False)
class ScoreTables(Additive):
    """`F_k = bias_k + sum over terms`, in floating point.

    Parameters
    ----------
    bias : ndarray of float, shape (K,)
        The scores with every switch open, before any joint is added.
    terms : tuple of Term
        A `Bit` for each switch, `Bins` for each joint (one row of zeros where others say all of it), and further terms:
        a `Line` for some joints, or a `Grid` for some pairs of joints, or terms of other kinds, which `collapse` turns
        into these. Each joint has one line at most, and is in one grid at most; with grids there are no lines.

    Examples
    --------
    >>> import numpy as np
    >>> from thenar.compiler import ScoreTables
    >>> bins = (np.array([100], np.uint16),)
    >>> tables = ScoreTables.of(np.zeros(2), np.array([[0.0, 1.0]]), bins, (np.array([[0.5, 0.0], [0.0, 0.5]]),))
    >>> tables.scores(np.array([[True], [False]]), np.array([[100], [101]])).tolist()
    [[0.5, 1.0], [0.0, 0.5]]
    """

    n_rounds: ClassVar[int] = 0
    stopped_early: ClassVar[bool] = False

    @classmethod
    def of(
        cls,
        bias: Floats,
        switch_rows: Floats,
        thresholds: Sequence[NDArray[np.uint16]],
        joint_rows: Sequence[Floats],
        further: Sequence[Term] = (),
    ) -> Self:
        """Return tables of the rows of switches (s, K), of thresholds (T_a,) and rows (T_a + 1, K) of each joint, and
        of further terms.
        """
        return cls(bias, (*terms_of(switch_rows, thresholds, joint_rows), *further))

    @property
    def magnitude(self) -> float:
        """The sum of the magnitudes that are added to collapse them: of terms of other kinds, and of the tables that
        they are added to.
        """
        if all(isinstance(term, Bit | Bins | Line | Grid) for term in self.terms):
            return 0.0
        parts = (part for term in self.terms for part in term.core())
        return sum((part.largest for part in parts), float(np.abs(self.bias).max()))

    def scores(self, bits: NDArray[np.bool_], codes: NDArray[Any]) -> Floats:
        """Return F (n, K) of the kept switches (n, s) and the joints' codes (n, j)."""
        # Add row by row: the last bits of a matrix product depend on the machine.
        scores = np.tile(self.bias, (len(bits), 1))
        for term in self.terms:
            scores += term.of(*self.values(term, bits, codes))
        return scores


def winners(scores: Floats) -> NDArray[np.intp]:
    """Return the class (n,) with the largest score of each row of (n, K); ties go to the lowest number."""
    best: NDArray[np.intp] = (scores >= scores.max(axis=1, keepdims=True) - TIE).argmax(axis=1)
    return best
