"""The worst case of rounding to integers, over all possible frames rather than a sample of them.

Rounding takes from the lead of class k over class l a sum over bias and inputs,

    scale * (F_k - F_l) - (I_k - I_l) = sum over inputs a of (e_a[k] - e_a[l])    with e_a = scale * row_a - steps_a,

and inputs are independent, except for the joints of a pair, which count as one input here. So the maximum is the sum of
the maxima of all inputs, and the bits and codes that reach them form the worst frame. All arithmetic is in integers:
nothing is rounded here.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import HIGHEST_CODE, IntegerTables, Slope

from .collapse import Floats, ScoreTables, first_codes

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
        if (len(tables.switch_rows), len(tables.joint_rows)) != (integers.n_switches, integers.n_joints):
            raise ValueError("the tables and the integers are of other inputs")
        choices = list(_choices(tables, integers))
        self._values = [choice.values for choice in choices[1:]]
        errors, self._step = _errors(choices, integers.scale)
        self._pairs = _Pairs(errors)

    def worst(self, leader: int, competitor: int) -> WorstFrame:
        """Return the frame that takes most from the lead of class `leader` over class `competitor`."""
        taken = self._pairs.taken(leader, competitor)
        # Ties go to the first: an open switch, the lowest code.
        picked = [choice.index(max(choice)) for choice in taken]
        values = [values[pick] for values, pick in zip(self._values, picked[1:], strict=True)]
        bits, codes = values[: self._n_switches], np.zeros(sum(map(len, self._units)), np.uint16)
        for unit, own in zip(self._units, values[self._n_switches :], strict=True):
            codes[list(unit)] = own
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

    Errors have a hundred bits and more, and a thousand classes have a million pairs. So errors are cut into parts small
    enough for sums of differences to fit machine words. The first parts alone bound every loss to within one unit per
    input on either side; the few pairs that may have the maximum are then computed with all parts.
    """

    def __init__(self, errors: list[Exact]) -> None:
        """Take the errors (c, K) of all inputs, c choices each."""
        self._inputs, self._n_classes = len(errors), errors[0].shape[1]
        self._bits = 61 - self._inputs.bit_length()
        longest = max(max(int(each.max()), -int(each.min())).bit_length() for each in errors)
        # Zeros behind all errors, so that the first part is a full one.
        self._padding = -(longest + 1) % self._bits
        self._shifts = range(longest + 1 + self._padding - self._bits, -1, -self._bits)
        self._parts = [self._cut(each << self._padding) for each in errors]
        by_choices: dict[int, list[NDArray[np.int64]]] = {}
        for parts in self._parts:
            by_choices.setdefault(parts.shape[1], []).append(parts)
        self._alike = [np.stack(group, axis=1) for group in by_choices.values()]
        self._first = np.stack([self._losses(k, slice(None), 1)[0] for k in range(self._n_classes)])

    def taken(self, leader: int, competitor: int) -> list[list[int]]:
        """Return by how much each choice of each input lowers the lead of `leader` over `competitor`."""
        return [self._whole(parts[:, :, leader] - parts[:, :, competitor]) for parts in self._parts]

    def greatest(self, tie: int) -> tuple[int, int, int]:
        """Return the greatest loss, its leader and its competitor: the first such pair.

        The loss counts `tie` less where the competitor has the higher number.
        """
        classes = np.arange(self._n_classes)
        # Sums are below 2^61: what is a quarter of a word off is further off than any two of them.
        off = min(tie << self._padding >> self._shifts[0], 1 << 62)
        near = self._first - off * (classes[:, np.newaxis] < classes)
        np.fill_diagonal(near, np.iinfo(np.int64).min)
        likely = near >= int(near.max()) - 2 * self._inputs - 2
        found = []
        for leader in np.flatnonzero(likely.any(axis=1)).tolist():
            competitors = np.flatnonzero(likely[leader])
            losses = self._whole(self._losses(leader, competitors, len(self._shifts)))
            pairs = zip(losses, competitors.tolist(), strict=True)
            found += [(loss - tie * (leader < competitor), leader, competitor) for loss, competitor in pairs]
        return max(found, key=lambda pair: pair[0])

    def _losses(self, leader: int, competitors: slice | NDArray[np.intp], parts: int) -> NDArray[np.int64]:
        """Return the losses of `leader` to m competitors in their first parts, (parts, m); only the first is signed."""
        totals = np.zeros((parts, len(np.arange(self._n_classes)[competitors])), np.int64)
        for group in self._alike:
            at_once = max(1, _WORDS // (group.shape[2] * totals.shape[1]))
            for start in range(0, group.shape[1], at_once):
                piece = group[:parts, start : start + at_once]
                apart = self._carried(piece[..., leader, np.newaxis] - piece[..., competitors])
                for part, differences in enumerate(apart):
                    most = differences.max(axis=1, keepdims=True)
                    totals[part] += most.sum(axis=(0, 1))
                    for later in apart[part + 1 :]:
                        # What is less in an earlier part is less: below anything that a later part can be.
                        later[differences < most] = -1
        return self._carried(totals)

    def _cut(self, errors: Exact) -> NDArray[np.int64]:
        """Return the parts (parts, c, K) of errors (c, K): the first with the sign, the others at least 0."""
        first, *others = self._shifts
        parts = [errors >> first, *(errors >> shift & (1 << self._bits) - 1 for shift in others)]
        return np.array(parts, np.int64)

    def _carried(self, parts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Bring all parts but the first back to 0 or more and below 2^bits, in place."""
        for part in range(len(parts) - 1, 0, -1):
            parts[part - 1] += parts[part] >> self._bits
            parts[part] &= (1 << self._bits) - 1
        return parts

    def _whole(self, parts: NDArray[np.int64]) -> list[int]:
        """Return the whole numbers of all parts (parts, m)."""
        padded = (zip(self._shifts, column, strict=True) for column in zip(*parts.tolist(), strict=True))
        return [sum(part << shift for shift, part in column) >> self._padding for column in padded]


@dataclass(frozen=True, slots=True, eq=False)
class _Choice:
    """What an input can say: values (c,), of the joints of a pair (c, 2), its rows in units of score, which are added
    up, (t, c, K), and in steps (c, K); and the row (K,) of its line, which is added `times` (c,).
    """

    values: NDArray[np.int64]
    rows: Floats
    steps: NDArray[np.integer]
    line: Floats
    times: NDArray[np.int64]


def _choices(tables: ScoreTables, integers: IntegerTables) -> Iterator[_Choice]:
    """Yield bias, switches and joints, those of a pair together."""
    none, never = 0 * tables.bias, np.zeros(1, np.int64)
    yield _Choice(np.zeros(1, np.int64), tables.bias[np.newaxis, np.newaxis], integers.bias[np.newaxis], none, never)
    for row, steps in zip(tables.switch_rows, integers.switch_rows, strict=True):
        rows = np.stack([0 * row, row])[np.newaxis]
        yield _Choice(np.arange(2), rows, np.stack([0 * steps, steps]), none, never)
    lines = {line.joint: line for line in tables.lines}
    for unit in integers.units:
        if len(unit) == 2:
            yield _of_pair(tables, integers, unit)
            continue
        joint = unit[0]
        one, other = tables.thresholds[joint], integers.thresholds[joint]
        slope, line = integers.slope_of(joint), lines.get(joint)
        codes = first_codes(one, other) if slope is None else _turning_codes(slope, one, other)
        rows, steps = _own(tables, integers, joint, codes)
        if slope is None or line is None:
            yield _Choice(codes, rows[np.newaxis], steps, none, never)
        else:
            above = np.clip(codes, line.low, line.high) - line.low
            yield _Choice(codes, rows[np.newaxis], steps + slope.of(codes), line.row, above)


def _own(
    tables: ScoreTables, integers: IntegerTables, joint: int, codes: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.int64]]:
    """Return the rows (c, K) of codes (c,) of a joint, in units of score and in steps."""
    rows = tables.joint_rows[joint][np.searchsorted(tables.thresholds[joint], codes)]
    return rows, integers.joint_rows[joint][np.searchsorted(integers.thresholds[joint], codes)].astype(np.int64)


def _of_pair(tables: ScoreTables, integers: IntegerTables, unit: tuple[int, ...]) -> _Choice:
    """Return the choices of a pair of joints: every bin of one combined with every bin of the other."""
    pair, whole = (next(pair for pair in each.pairs if pair.joints == unit) for each in (tables, integers))
    each = [
        first_codes(tables.thresholds[joint], integers.thresholds[joint], steps)
        for joint, steps in zip(unit, pair.thresholds, strict=True)
    ]
    codes = np.stack(np.meshgrid(*each, indexing="ij"), axis=-1).reshape(-1, 2)
    all_codes = np.zeros((len(codes), integers.n_joints), np.int64)
    all_codes[:, list(unit)] = codes
    (one, steps), (other, more) = (_own(tables, integers, joint, all_codes[:, joint]) for joint in unit)
    rows = np.stack([one, other, pair.of(all_codes)])
    return _Choice(codes, rows, steps + more + whole.of(all_codes), 0 * tables.bias, np.zeros(1, np.int64))


def _turning_codes(slope: Slope, *thresholds: NDArray[np.uint16]) -> NDArray[np.int64]:
    """Return codes among which, in every bin, are those of the largest and of the least error.

    Within a bin, errors at the first of the codes that become one distance lie on a straight line, and so do those at
    the last ones: the ends of both lines are among the codes about each end of the bin.
    """
    cell = 1 << max(-slope.gain, 0)
    last = np.concatenate([each.astype(np.int64) for each in thresholds])
    ends = np.concatenate([[0, HIGHEST_CODE], last, last + 1])
    firsts = slope.low + (np.clip(ends, slope.low, slope.high) - slope.low) // cell * cell
    about = (firsts + near for near in (-1, 0, cell - 1, cell))
    return np.unique(np.clip(np.concatenate([ends, [slope.low, slope.high], *about]), 0, HIGHEST_CODE))


def _errors(choices: list[_Choice], scale: float) -> tuple[list[Exact], int]:
    """Return scale * rows - steps of every choice, (c, K), as whole numbers; and how many of them make a step."""
    cut = [(np.frexp(choice.rows), np.frexp(choice.line)) for choice in choices]
    # Doubles are whole numbers below 2^53 times a power of two: the least power is a grid for all.
    lowest = min(0, *(int(powers.min()) - 53 for both in cut for _, powers in both))
    above, below = scale.as_integer_ratio()
    step = below << -lowest
    errors = []
    for choice, (rows, line) in zip(choices, cut, strict=True):
        whole = _whole(*rows, lowest).sum(axis=0) + choice.times.astype(object)[:, np.newaxis] * _whole(*line, lowest)
        errors.append(whole * above - choice.steps.astype(object) * step)
    return errors, step


def _whole(mantissas: Floats, powers: NDArray[np.int32], lowest: int) -> Exact:
    whole: Exact = np.ldexp(mantissas, 53).astype(np.int64).astype(object) << (powers - 53 - lowest).astype(object)
    return whole
