"""The same frames through the ensemble, the float tables and the integer tables: differences held against bounds."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...runtime.scorer import LANE_OFFSET, Scorer
from ...runtime.tables import IntegerTables
from ..boosting.stumps import Stumps, winners
from .collapse import Floats, collapse

COLLAPSE_TOLERANCE = 1e-12  # of the sum of the magnitudes that are added up
SLACK_STEPS = 1e-6  # what doubles may lose while scores of some 1e4 steps are scaled and compared

Flags = NDArray[np.bool_]
Labels = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """What became of n rows on the way from the ensemble to integers.

    collapse_difference and its bound are in units of score, integer_difference and its bound in steps. trained and
    deployed (n,) are the classes by the ensemble and by the integers, covered (n,) the rows whose float margin is
    beyond doubt.
    """

    collapse_difference: float
    collapse_bound: float
    integer_difference: float
    integer_bound: float
    safe_margin: float
    trained: Labels
    deployed: Labels
    margins: Floats
    covered: Flags

    @property
    def changed(self) -> Labels:
        """Numbers of the rows that the integers give another class."""
        return np.flatnonzero(self.trained != self.deployed)

    @property
    def holds(self) -> bool:
        """Whether both differences are within their bounds and no covered row changes class."""
        collapsed = self.collapse_difference <= self.collapse_bound
        rounded = self.integer_difference <= self.integer_bound + SLACK_STEPS
        return collapsed and rounded and not self.covered[self.changed].any()


def rounding_error(n_inputs: int) -> float:
    """Return the most steps that rounding can move a score: half for the bias, half for the row of each input."""
    return (n_inputs + 1) / 2


def compare(
    stumps: Stumps,
    integers: IntegerTables,
    bits: Flags,
    codes: NDArray[np.uint16],
    report: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Send the kept switches (n, s) and codes (n, j) through all three; the integers frame by frame, as they run."""
    tables = collapse(stumps, bits.shape[1])
    by_stumps = stumps.scores(np.hstack([bits, codes]))
    by_tables = tables.scores(bits, codes)
    by_integers = _deployed_scores(integers, bits, codes, report)
    steps = by_tables * integers.scale
    best_two = np.sort(steps, axis=1)[:, -2:]
    margins = best_two[:, 1] - best_two[:, 0]
    error = rounding_error(tables.n_inputs)
    magnitudes = 2 * stumps.shrinkage * np.abs(stumps.values[:, :, :2]).max(axis=(1, 2), initial=0).sum()
    return Comparison(
        collapse_difference=float(np.abs(by_stumps - by_tables).max()),
        collapse_bound=COLLAPSE_TOLERANCE * float(magnitudes),
        integer_difference=float(np.abs(steps - by_integers).max()),
        integer_bound=error,
        safe_margin=2 * error,
        trained=winners(by_stumps),
        deployed=by_integers.argmax(axis=1),
        margins=margins,
        covered=margins > 2 * error + SLACK_STEPS,
    )


def _deployed_scores(
    integers: IntegerTables, bits: Flags, codes: NDArray[np.uint16], report: Callable[[int, int], None] | None
) -> NDArray[np.int64]:
    scorer = Scorer(integers)
    scores = np.empty((len(bits), integers.n_classes), np.int64)
    for row, (switches, joints) in enumerate(zip(bits, codes, strict=True)):
        scores[row] = scorer.lanes(switches, joints)
        if report is not None and row % 1000 == 999:
            report(row + 1, len(bits))
    return scores - LANE_OFFSET
