"""The interface of terms, and the registry of their kinds."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.members import Members

Floats = NDArray[np.float64]
Rows = NDArray[Any]
Ends = tuple[Rows, Rows]

HIGHEST_CODE = 65535


class Term(ABC):
    """One summand of an additive model: a row of K numbers, one a grasp type, that depends on one or two inputs.

    Integer tables, proofs, files for boards and C know four kinds, the `CoreTerm`s: `Bit`, `Bins`, `Line` and `Grid`.
    Any other kind says which of these its terms consist of. It is a frozen dataclass of arrays, which a build stores.

    Attributes
    ----------
    name : str
        The name of the kind, in the files of builds.
    """

    __slots__ = ()
    name: ClassVar[str]

    @property
    @abstractmethod
    def inputs(self) -> tuple[int, ...]:
        """The numbers of the joints that it depends on; of a `Bit`, the switch."""

    @abstractmethod
    def of(self, *values: NDArray[Any]) -> Rows:
        """Return the contribution (n, K) to n frames, given the values (n,) of each of its inputs."""

    @abstractmethod
    def core(self) -> "tuple[CoreTerm, ...]":
        """Return terms of the four kinds whose sum is this one, at every code."""

    def arrays(self) -> Mapping[str, NDArray[Any]]:
        """Return its fields, by name."""
        return {field.name: np.asarray(getattr(self, field.name)) for field in fields(self)}  # type: ignore[arg-type]

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Return the term with these fields. Raises KeyError, TypeError or ValueError for others."""
        return cls(**arrays)


class CoreTerm(Term):
    """A term of one of the four kinds that boards read: its rows are scores, or whole steps in integer tables.

    Attributes
    ----------
    stepped : bool
        Whether the contribution is constant between `steps`.
    """

    __slots__ = ()
    stepped: ClassVar[bool] = True

    def core(self) -> "tuple[CoreTerm, ...]":
        """Return the term."""
        return (self,)

    @property
    @abstractmethod
    def steps(self) -> tuple[NDArray[Any], ...]:
        """For each input, in order, the codes after which the contribution changes."""

    @property
    @abstractmethod
    def ends(self) -> Ends:
        """The largest and the smallest contribution to each type, (K,) and (K,)."""

    @property
    def n_rows(self) -> int:
        """The number of its rows."""
        return 1

    @property
    def largest(self) -> float:
        """The largest absolute contribution to any type."""
        return max(float(np.abs(end).max()) for end in self.ends)

    def parts(self, *values: NDArray[Any]) -> tuple[Rows, NDArray[np.int64]]:
        """Return rows (n, K), or (1, K), and the whole numbers (n, 1), or (1, 1), by which they count at these values:
        their products are the contribution, exactly.
        """
        return self.of(*values), np.ones((1, 1), np.int64)

    def turning(self, ends: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return codes among which, with these `ends` (m,) of bins, are those of the largest and of the least rounding
        error in each bin; none where the contribution is stepped.
        """
        return ends[:0]

    @abstractmethod
    def relative(self) -> Self:
        """Return the term of scores relative to the last class."""

    @abstractmethod
    def whole(self, scale: float, grid: int) -> Self:
        """Return the term of scores in whole steps, `scale` a unit of score; rows of switches and bins are multiples of
        `grid`. They are doubles still.
        """

    @abstractmethod
    def rounding_error(self, scale: float, grid: int) -> float:
        """Return the most steps by which `whole` moves the contribution."""

    @abstractmethod
    def integers(self) -> Self:
        """Return the term of whole steps with its rows as integers."""


class Tabulated(CoreTerm):
    """A term that adds one of its rows (..., K); rows on a grid are multiples of it."""

    __slots__ = ()
    rows: Rows

    @property
    def cells(self) -> Rows:
        """The rows, one after the other, (n_rows, K)."""
        return self.rows.reshape(-1, self.rows.shape[-1])

    @property
    def n_rows(self) -> int:
        """The number of its rows."""
        return len(self.cells)

    @property
    def ends(self) -> Ends:
        """The largest and the smallest contribution to each type, (K,) and (K,)."""
        return self.cells.max(axis=0), self.cells.min(axis=0)

    def grid_of(self, grid: int) -> int:
        """Return the grid of its rows in tables on a `grid`."""
        return 1

    def relative(self) -> Self:
        """Return the term of scores relative to the last class."""
        return self._of_rows(less_last(self.rows))

    def whole(self, scale: float, grid: int) -> Self:
        """Return the term in whole steps."""
        return self._of_rows(rounded(self.rows * scale, self.grid_of(grid)))

    def rounding_error(self, scale: float, grid: int) -> float:
        """Return half of the grid."""
        return self.grid_of(grid) / 2

    def integers(self) -> Self:
        """Return the term with its rows as int16."""
        return self._of_rows(self.rows.astype(np.int16))

    def _of_rows(self, rows: Rows) -> Self:
        return replace(self, rows=rows)  # type: ignore[type-var]


def rounded(rows: Floats, grid: int = 1) -> Floats:
    """Return rows rounded to multiples of `grid`, half to even."""
    whole: Floats = np.rint(rows / grid) * grid
    return whole


def less_last(rows: Rows) -> Rows:
    """Return rows (..., K) relative to the last class."""
    relative: Rows = rows - rows[..., -1:]
    return relative


# The kinds of terms by name: members are classes.
TERMS: Members[type[Term]] = Members("kind of term", type, "thenar.runtime.model.terms", "thenar.terms", base=Term)
