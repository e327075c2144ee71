"""How much rounding can change a score at worst, over all possible frames rather than a sample of them.

Rounding takes from the lead of class k over class l a sum over bias and inputs,

    scale * (F_k - F_l) - (I_k - I_l) = sum over inputs a of (e_a[k] - e_a[l])    with e_a = scale * row_a - steps_a,

and inputs are independent, except for the joints of a grid, which count as one input here. So the maximum is the sum of
the maxima of all inputs, and the bits and codes that reach them form the worst frame. All arithmetic is in integers:
nothing is rounded here.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from .integers import IntegerTables
from .tables import ScoreTables
from .terms.base import HIGHEST_CODE, CoreTerm, Floats
from .terms.bit import Bit

Exact = NDArray[np.object_]  # of Python integers

# Differences kept in memory at a time: they fit a processor's cache.
_WORDS = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class WorstFrame:
    """The frame, bits (s,) and codes (j,), in which class `leader` loses the most, `loss` steps, over `competitor`.

    A negative loss is a gain. Lead and loss are exact.
    """

    leader: int
    competitor: int
    loss: Fraction
    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]


class Rounding:
    """The rounding errors of integer tables made from score tables."""

    __slots__ = ("_n_switches", "_pairs", "_step", "_units", "_values")

    def __init__(self, tables: ScoreTables, integers: IntegerTables) -> None:
        """Compare the two, bin by bin of both. They must have the same classes and inputs."""
        self._n_switches, self._units = integers.n_switches, integers.units
        if (tables.n_switches, tables.n_joints) != (integers.n_switches, integers.n_joints):
            raise ValueError("the tables and the integers are of other inputs")
        choices = list(_choices(tables, integers))
        self._values = [values for values, _, _ in choices[1:]]
        errors, self._step = _errors(choices, integers.scale)
        self._pairs = _Pairs(errors)

    def worst(self, leader: int, competitor: int) -> WorstFrame:
        """Return the frame that takes most from the lead of class `leader` over class `competitor`."""
        taken = self._pairs.taken(leader, competitor)
        # Ties go to the first: an open switch, the lowest code.
        picked = [choice.index(max(choice)) for choice in taken]
        values = [values[pick] for values, pick in zip(self._values, picked[1:], strict=True)]
        bits = [state for (state,) in values[: self._n_switches]]
        codes = np.zeros(sum(map(len, self._units)), np.uint16)
        for unit, of_unit in zip(self._units, values[self._n_switches :], strict=True):
            codes[list(unit)] = of_unit
        loss = Fraction(sum(map(max, taken)), self._step)
        return WorstFrame(leader, competitor, loss, np.array(bits, bool), codes)

    def worst_of_all(self) -> WorstFrame:
        """Return the worst frame over all pairs of classes; ties go to the first pair."""
        _, leader, competitor = self._pairs.greatest(0)
        return self.worst(leader, competitor)

    def safe_margin(self) -> Fraction:
        """Return the least margin, in steps, of which this is proved: a frame whose best score leads by more keeps it.

        Where class k leads and the integers say l, I_l - I_k is at least 0, or 1 if l has the higher number and so
        loses ties; and the lead of k over l is the loss less that.
        """
        return max(Fraction(self._pairs.greatest(self._step)[0], self._step), Fraction(0))


class _Pairs:
    """The maximal loss of every ordered pair of classes: the sum over inputs of the largest difference of errors.

    Errors have a hundred bits and more, and a thousand classes have a million pairs. So errors are cut so far that sums
    of differences fit machine words, which bounds every loss to within one unit per input on either side; the few pairs
    that may have the maximum are then computed exactly.
    """

    def __init__(self, errors: list[Exact]) -> None:
        """Take the errors (c, K) of all inputs, c choices each."""
        self._errors, n_classes = errors, errors[0].shape[1]
        longest = max(max(int(each.max()), -int(each.min())).bit_length() for each in errors)
        self._shift = max(longest + 1 - (61 - len(errors).bit_length()), 0)
        self._first = np.zeros((n_classes, n_classes), np.int64)
        for exact in errors:
            cut = (exact >> self._shift).astype(np.int64)
            at_once = max(1, _WORDS // cut.size)
            for start in range(0, n_classes, at_once):
                leaders = slice(start, start + at_once)
                self._first[leaders] += (cut[:, leaders, np.newaxis] - cut[:, np.newaxis]).max(axis=0)

    def taken(self, leader: int, competitor: int) -> list[list[int]]:
        """Return by how much each choice of each input lowers the lead of `leader` over `competitor`."""
        return [(each[:, leader] - each[:, competitor]).tolist() for each in self._errors]

    def greatest(self, tie: int) -> tuple[int, int, int]:
        """Return the greatest loss, its leader and its competitor: the first such pair.

        The loss counts `tie` less where the competitor has the higher number.
        """
        classes = np.arange(len(self._first))
        # Sums are below 2^61: what is a quarter of a word off is further off than any two of them.
        off = min(tie >> self._shift, 1 << 62)
        near = self._first - off * (classes[:, np.newaxis] < classes)
        np.fill_diagonal(near, np.iinfo(np.int64).min)
        likely: list[list[int]] = np.argwhere(near >= int(near.max()) - 2 * len(self._errors) - 2).tolist()
        found = [
            (sum(map(max, self.taken(leader, competitor))) - tie * (leader < competitor), leader, competitor)
            for leader, competitor in likely
        ]
        return max(found, key=lambda pair: pair[0])


# What a unit can say: values (c, inputs), the parts of its rows in units of score (`Term.parts`), which are added up,
# and its rows in steps (c, K).
_Choice = tuple[NDArray[np.int64], tuple[tuple[Floats, NDArray[np.int64]], ...], NDArray[np.integer]]


def _choices(tables: ScoreTables, integers: IntegerTables) -> Iterator[_Choice]:
    """Yield bias, switches and joints, those of a grid together."""
    once = np.ones((1, 1), np.int64)
    yield np.zeros((1, 0), np.int64), ((tables.bias[np.newaxis], once),), integers.bias[np.newaxis]
    for bit, whole in zip(tables.bits, integers.bits, strict=True):
        states = np.arange(2)
        yield states[:, np.newaxis], (bit.parts(states),), whole.of(states)
    for unit in integers.units:
        ours, theirs = (
            [term for term in of.core_terms if not isinstance(term, Bit) and set(term.inputs) <= set(unit)]
            for of in (tables, integers)
        )
        codes = np.meshgrid(*(_turning_codes(joint, [*ours, *theirs]) for joint in unit), indexing="ij")
        of_joint = dict(zip(unit, (each.ravel() for each in codes), strict=True))
        parts = tuple(term.parts(*(of_joint[joint] for joint in term.inputs)) for term in ours)
        steps = [term.of(*(of_joint[joint] for joint in term.inputs)) for term in theirs]
        yield np.stack([*of_joint.values()], axis=1), parts, np.sum(steps, axis=0, dtype=np.int64)


def _turning_codes(joint: int, terms: Sequence[CoreTerm]) -> NDArray[np.int64]:
    """Return codes of a joint among which, in every bin of `terms`, are those of the largest and of the least error."""
    last = [
        steps.astype(np.int64)
        for term in terms
        for number, steps in zip(term.inputs, term.steps, strict=True)
        if number == joint and term.stepped
    ]
    codes = np.concatenate([[0], *(steps + 1 for steps in last)])
    ends = np.concatenate([[0, HIGHEST_CODE], *last, codes])
    turning = [term.turning(ends) for term in terms if not term.stepped and term.inputs == (joint,)]
    if turning:
        return np.unique(np.clip(np.concatenate([ends, *turning]), 0, HIGHEST_CODE))
    return np.unique(codes[codes <= HIGHEST_CODE])


def _errors(choices: Sequence[_Choice], scale: float) -> tuple[list[Exact], int]:
    """Return scale * rows - steps of every choice, (c, K), as whole numbers; and how many of them make a step."""
    cut = [[(np.frexp(rows), times) for rows, times in parts] for _, parts, _ in choices]
    # Doubles are whole numbers below 2^53 times a power of two: the least power is a grid for all.
    lowest = min(0, *(int(powers.min()) - 53 for parts in cut for (_, powers), _ in parts))
    above, below = scale.as_integer_ratio()
    step = below << -lowest
    errors = []
    for (_, _, steps), parts in zip(choices, cut, strict=True):
        exact = sum(_whole(*rows, lowest) * times.astype(object) for rows, times in parts)
        errors.append(exact * above - steps.astype(object) * step)
    return errors, step


def _whole(mantissas: Floats, powers: NDArray[np.int32], lowest: int) -> Exact:
    whole: Exact = np.ldexp(mantissas, 53).astype(np.int64).astype(object) << (powers - 53 - lowest).astype(object)
    return whole
