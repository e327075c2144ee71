"""What is proved of a build's integers, frame by frame and over all the frames there are."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thenar.runtime.tables import IntegerTables

from ..boosting.stumps import TIE
from ..tables.collapse import Model, collapse
from ..tables.compare import Comparison
from ..tables.furthest import furthest
from ..tables.worstcase import Rounding


@dataclass(frozen=True, slots=True)
class Guarantee:
    """Differences beside their bounds, and the worst case.

    collapse_*   ensemble against float tables on the rows trained on, in units of score
    integer_*    float tables against integers on them, in steps
    loss         the most steps that the lead of `leader` over `rival` can lose, over all frames; at most `loss_bound`
    safe_margin  leads of more steps than this keep their grasp type, proved over all frames: `covered` of `rows`
    reach        the furthest that a sum can get from zero, in any order, inputs missing or not
    """

    rows: int
    collapse_difference: float
    collapse_bound: float
    integer_difference: float
    integer_bound: float
    leader: str
    rival: str
    loss: float
    loss_bound: float
    safe_margin: float
    covered: int
    changed: int
    reach: int


def guarantee_of(model: Model, integers: IntegerTables, comparison: Comparison, grasps: Sequence[str]) -> Guarantee:
    """Return what holds of `integers`, which were made of `model` and compared with them on the rows trained on."""
    rounding = Rounding(collapse(model, integers.n_switches), integers)
    worst, safe = rounding.worst_of_all(), float(rounding.safe_margin())
    # Scores that the ensemble takes for tied are decided by the number of the class.
    covered = comparison.margins > max(safe, TIE * integers.scale) + 2 * comparison.slack
    return Guarantee(
        rows=len(comparison.margins),
        collapse_difference=comparison.collapse_difference,
        collapse_bound=comparison.collapse_bound,
        integer_difference=comparison.integer_difference,
        integer_bound=comparison.integer_bound + comparison.slack,
        leader=grasps[worst.leader],
        rival=grasps[worst.rival],
        loss=float(worst.loss),
        loss_bound=comparison.safe_margin + 2 * comparison.slack,
        safe_margin=safe,
        covered=int(np.count_nonzero(covered)),
        changed=len(comparison.changed),
        reach=furthest(integers).total,
    )
