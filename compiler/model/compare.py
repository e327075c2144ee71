"""The same frames through the ensemble, the float tables and the integer tables: differences compared with bounds."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.quantise import as_deployed, rounding_error
from thenar.runtime.model.tables import ScoreTables, winners
from thenar.runtime.model.terms.base import HIGHEST_CODE, CoreTerm
from thenar.runtime.model.terms.bit import Bit
from thenar.runtime.model.terms.line import Line
from thenar.runtime.scores import LANE_OFFSET, Scorer

from ..elementary import Floats
from ..trainers.base import Model
from .collapse import collapse

COLLAPSE_TOLERANCE = 1e-12  # of the sum of the magnitudes that are added up

Flags = NDArray[np.bool_]
Labels = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """The results for n rows on the way from the ensemble to integers.

    collapse_difference and its bound are in units of score; integer_difference, its bound and the additional error of
    doubles, the slack, are in steps; integer_worst is the difference in the worst of all frames, recorded or not.
    trained and deployed (n,) are the classes by the ensemble and by the integers, covered (n,) the rows whose float
    margin exceeds the safe margin.
    """

    collapse_difference: float
    collapse_bound: float
    integer_difference: float
    integer_worst: float
    integer_bound: float
    slack: float
    safe_margin: float
    trained: Labels
    deployed: Labels
    margins: Floats
    covered: Flags

    @property
    def changed(self) -> Labels:
        """The indices of the rows whose class the integers change."""
        return np.flatnonzero(self.trained != self.deployed)

    @property
    def holds(self) -> bool:
        """Whether all differences are within their bounds and no covered row changes class."""
        collapsed = self.collapse_difference <= self.collapse_bound
        rounded = max(self.integer_difference, self.integer_worst) <= self.integer_bound + self.slack
        return collapsed and rounded and not self.covered[self.changed].any()


def worst_difference(tables: ScoreTables, integers: IntegerTables) -> float:
    """Return the most steps by which a score of the integers, made from these tables, is off in any frame.

    Inputs are independent, except for the joints of a grid: a score is off by most, or least, where every input is.
    """
    greatest = least = integers.scale * tables.bias - integers.bias
    for off in _differences(tables, integers):
        greatest, least = greatest + off.max(axis=0), least + off.min(axis=0)
    return float(max(greatest.max(), -least.min()))


def _differences(tables: ScoreTables, integers: IntegerTables) -> Iterator[Floats]:
    """Yield the differences (c, K) of every input alone, or of both joints of a grid, the largest ones among them."""
    states = np.arange(2)
    for bit, whole in zip(tables.bits, integers.bits, strict=True):
        yield integers.scale * bit.of(states) - whole.of(states)
    for unit in integers.units:
        ours, theirs = (
            [term for term in of.core_terms if not isinstance(term, Bit) and {*term.inputs} <= {*unit}]
            for of in (tables, integers)
        )
        # Scores lie on straight lines between these codes, and steps are constant.
        stepped = [*theirs, *(term for term in ours if not isinstance(term, Line))]
        codes = [_codes_about_steps(joint, stepped) for joint in unit]
        at = dict(zip(unit, (each.ravel() for each in np.meshgrid(*codes, indexing="ij")), strict=True))
        scores, steps = (
            np.sum([term.of(*(at[joint] for joint in term.inputs)) for term in terms], axis=0, dtype=np.float64)
            for terms in (ours, theirs)
        )
        yield integers.scale * scores - steps


def _codes_about_steps(joint: int, terms: Iterable[CoreTerm]) -> NDArray[np.int64]:
    """Return the codes before and after every step of the terms of a joint, and the ends of all codes."""
    steps = [
        steps.astype(np.int64)
        for term in terms
        for number, steps in zip(term.inputs, term.steps, strict=True)
        if number == joint
    ]
    codes = np.concatenate([[0, HIGHEST_CODE], *steps, *(after + 1 for after in steps)])
    return np.unique(codes[codes <= HIGHEST_CODE])


def float_slack(tables: ScoreTables, scale: float) -> float:
    """Return the largest additional error of a score, in steps, from arithmetic with doubles.

    It arises on the way to integers and in the comparison. With n inputs, j of them joints, u = 2^-53 and S the sum of
    the largest magnitudes of all rows, it is scale * u * S times j for the bias that `balance` sums up, 2 for its rows,
    each at most twice as large as before, 3 for scaling these and the bias, n for adding up the scores compared with
    and 1 for scaling them; and 2 for products of u. A line is two more rows, each at its maximum, and adds 4: a
    product, a sum, and two by which its middle moves. A grid is one more row, and adds 1.
    """
    largest = sum((term.largest for term in (*tables.core_terms, *tables.lines)), float(np.abs(tables.bias).max()))
    operations = len(tables.terms) + tables.n_joints + 3 * len(tables.lines) + 8
    return operations * 2.0**-53 * largest * scale


def compare(
    model: Model,
    integers: IntegerTables,
    bits: Flags,
    codes: NDArray[np.uint16],
    report: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Run kept switches (n, s) and codes (n, j) through all three; the integers frame by frame, as deployed."""
    tables = collapse(model, bits.shape[1])
    scores = model.scores(bits, codes)
    by_tables = tables.scores(bits, codes)
    scorer, by_integers = Scorer(integers), np.empty((len(bits), integers.n_classes), np.int64)
    for row, (switches, joints) in enumerate(zip(bits, codes, strict=True)):
        by_integers[row] = scorer.biased_scores(switches, joints)
        if report is not None and row % 1000 == 999:
            report(row + 1, len(bits))
    by_integers -= LANE_OFFSET
    tables = as_deployed(tables, integers.grid)
    steps = tables.scores(bits, codes) * integers.scale
    best_two = np.sort(steps, axis=1)[:, -2:]
    margins = best_two[:, 1] - best_two[:, 0]
    error, slack = rounding_error(tables, integers.scale, integers.grid), float_slack(tables, integers.scale)
    return Comparison(
        collapse_difference=float(np.abs(scores - by_tables).max()),
        collapse_bound=COLLAPSE_TOLERANCE * model.magnitude,
        integer_difference=float(np.abs(steps - by_integers).max()),
        integer_worst=worst_difference(tables, integers),
        integer_bound=error,
        slack=slack,
        safe_margin=2 * error,
        trained=winners(scores),
        deployed=by_integers.argmax(axis=1),
        margins=margins,
        covered=margins > 2 * (error + slack),
    )
