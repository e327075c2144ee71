"""The same frames through the ensemble, the float tables and the integer tables: differences compared with bounds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.model.integers import LIMIT, IntegerTables
from thenar.runtime.model.proof import Rounding
from thenar.runtime.model.quantise import as_deployed, rounding_error
from thenar.runtime.model.tables import TIE, ScoreTables, winners
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
    doubles, the slack, are in steps. trained and deployed (n,) are the classes by the ensemble and by the integers,
    covered (n,) the rows whose float margin exceeds the safe margin.
    """

    collapse_difference: float
    collapse_bound: float
    integer_difference: float
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
        """Whether both differences are within their bounds and no covered row changes class."""
        collapsed = self.collapse_difference <= self.collapse_bound
        rounded = self.integer_difference <= self.integer_bound + self.slack
        return collapsed and rounded and not self.covered[self.changed].any()


class WorstCase(Struct, frozen=True, kw_only=True):
    """What integers can do at worst, in steps, exactly and over every frame there is, recorded or not.

    In the frame `closed` (names of kept switches) and `codes`, `leader` loses most of its lead over `competitor`.
    A margin above safe_margin keeps its grasp type: true of `covered` rows, of which `covered_changed` change all the
    same. No sum gets further than `reach` from zero, in any order, whole or with inputs missing.
    """

    leader: str
    competitor: str
    loss: float
    bound: float
    closed: tuple[str, ...]
    codes: tuple[int, ...]
    safe_margin: float
    covered: int
    covered_changed: int
    reach: int
    limit: int = LIMIT

    @property
    def holds(self) -> bool:
        """Whether no lead can lose more than the bound, and no covered row changes."""
        return self.loss <= self.bound and not self.covered_changed


def worst_case(
    model: Model, integers: IntegerTables, comparison: Comparison, grasps: Sequence[str], switches: Sequence[str]
) -> WorstCase:
    """Return the proof about `integers` over all frames, and which rows of `comparison` that covers.

    They were made from `model`; `grasps` and `switches` are the names of its classes and kept switches.
    """
    rounding = Rounding(as_deployed(collapse(model, integers.n_switches), integers.grid), integers)
    frame, safe = rounding.worst_of_all(), float(rounding.safe_margin())
    # Scores that the ensemble treats as tied are decided by the number of the class.
    covered = comparison.margins > max(safe, TIE * integers.scale) + 2 * comparison.slack
    return WorstCase(
        leader=grasps[frame.leader],
        competitor=grasps[frame.competitor],
        loss=float(frame.loss),
        bound=comparison.safe_margin + 2 * comparison.slack,
        closed=tuple(name for name, bit in zip(switches, frame.bits.tolist(), strict=True) if bit),
        codes=tuple(frame.codes.tolist()),
        safe_margin=safe,
        covered=int(np.count_nonzero(covered)),
        covered_changed=int(np.count_nonzero(covered[comparison.changed])),
        reach=integers.bound,
    )


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
        integer_bound=error,
        slack=slack,
        safe_margin=2 * error,
        trained=winners(scores),
        deployed=by_integers.argmax(axis=1),
        margins=margins,
        covered=margins > 2 * (error + slack),
    )
