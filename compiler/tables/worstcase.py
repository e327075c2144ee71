"""The worst that rounding to integers can do, over every frame there is and not over a sample of them.

What rounding takes from the lead of class k over class l is a sum over bias and inputs,

    scale * (F_k - F_l) - (I_k - I_l) = sum over inputs a of (e_a[k] - e_a[l])    with e_a = scale * row_a - steps_a,

and no input knows of the others. So the most it can take is the sum of the most that it takes in each input, and the
bits and codes at which it does so make up the frame. All of it is done in whole numbers: nothing is rounded here.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ...runtime.tables import IntegerTables
from .collapse import HIGHEST_CODE, Floats, ScoreTables

Exact = NDArray[np.object_]  # of Python's integers


@dataclass(frozen=True, slots=True, eq=False)
class WorstFrame:
    """The frame, bits (s,) and codes (j,), in which class `leader` loses most of its lead over `rival`: `loss` steps.

    A negative loss is a gain. Lead and loss are exact.
    """

    leader: int
    rival: int
    loss: Fraction
    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]


class Rounding:
    """What rounding took from the rows of score tables when it made integer tables of them."""

    __slots__ = ("_errors", "_losses", "_n_switches", "_step", "_values")

    def __init__(self, tables: ScoreTables, integers: IntegerTables) -> None:
        """Compare the two, bin by bin of either. They must have the same classes and inputs."""
        choices = list(_choices(tables, integers))
        self._n_switches = integers.n_switches
        self._values = [choice.values for choice in choices[1:]]
        self._errors, self._step = _errors(choices, integers.scale)
        self._losses: Exact = np.add.reduce([_pairs(errors) for errors in self._errors])

    def worst(self, leader: int, rival: int) -> WorstFrame:
        """Return the frame that takes most from the lead of class `leader` over class `rival`."""
        taken = [errors[:, leader] - errors[:, rival] for errors in self._errors]
        # Of equal ones the first: an open switch, the lowest code.
        values = [values[int(np.argmax(most))] for values, most in zip(self._values, taken[1:], strict=True)]
        bits, codes = values[: self._n_switches], values[self._n_switches :]
        loss = Fraction(self._losses[leader, rival], self._step)
        return WorstFrame(leader, rival, loss, np.array(bits, bool), np.array(codes, np.uint16))

    def worst_of_all(self) -> WorstFrame:
        """Return the worst frame of the pair of classes that has the worst; of equal pairs of the first."""
        return self.worst(*self._greatest(self._losses))

    def safe_margin(self) -> Fraction:
        """Return the least margin, in steps, of which this is proved: a frame whose best score leads by more keeps it.

        Where class k leads and the integers say l, I_l - I_k is at least 0, or 1 if l has the higher number and so
        loses ties; and the lead of k over l is the loss less that.
        """
        must_be_better = np.triu(np.ones(self._losses.shape, bool), 1).astype(object)
        overturned = self._losses - must_be_better * self._step
        return max(Fraction(overturned[self._greatest(overturned)], self._step), Fraction(0))

    @staticmethod
    def _greatest(pairs: Exact) -> tuple[int, int]:
        others = ((k, other) for k in range(len(pairs)) for other in range(len(pairs)) if k != other)
        return max(others, key=lambda pair: pairs[pair])


@dataclass(frozen=True, slots=True, eq=False)
class _Choice:
    """What an input can say: values (c,), its rows (c, K) in units of score and in steps."""

    values: NDArray[np.int64]
    rows: Floats
    steps: NDArray[np.int16]


def _choices(tables: ScoreTables, integers: IntegerTables) -> Iterator[_Choice]:
    """Yield bias, switches and joints."""
    yield _Choice(np.zeros(1, np.int64), tables.bias[np.newaxis], integers.bias[np.newaxis])
    for row, steps in zip(tables.switch_rows, integers.switch_rows, strict=True):
        yield _Choice(np.arange(2), np.stack([0 * row, row]), np.stack([0 * steps, steps]))
    for one, rows, other, steps in zip(
        tables.thresholds, tables.joint_rows, integers.thresholds, integers.joint_rows, strict=True
    ):
        # The smallest code of each bin of either stands for all of its codes.
        codes = np.concatenate([[0], np.union1d(one, other).astype(np.int64) + 1])
        codes = codes[codes <= HIGHEST_CODE]
        yield _Choice(codes, rows[np.searchsorted(one, codes)], steps[np.searchsorted(other, codes)])


def _errors(choices: list[_Choice], scale: float) -> tuple[list[Exact], int]:
    """Return scale * rows - steps of every choice, (c, K), as whole numbers; and how many of them make a step."""
    ratios = [[value.as_integer_ratio() for value in choice.rows.ravel().tolist()] for choice in choices]
    # Denominators of doubles are powers of two: the greatest is a multiple of all.
    grid = max(below for values in ratios for _, below in values)
    above, below = scale.as_integer_ratio()
    step = grid * below
    errors = []
    for choice, values in zip(choices, ratios, strict=True):
        scaled = [number * (grid // denominator) * above for number, denominator in values]
        exact = [one - steps * step for one, steps in zip(scaled, choice.steps.ravel().tolist(), strict=True)]
        errors.append(np.array(exact, object).reshape(choice.rows.shape))
    return errors, step


def _pairs(errors: Exact) -> Exact:
    """Return, for every ordered pair of classes, the most by which the first column of (c, K) exceeds the second."""
    most: Exact = np.stack([(errors[:, [k]] - errors).max(axis=0) for k in range(errors.shape[1])])
    return most
