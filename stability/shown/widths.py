"""What integers of 4 to 16 bits cost: the worst error there is, and how many unseen rows keep their grasp type."""

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import winners
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.tables.collapse import collapse
from thenar.compiler.tables.quantise import quantise
from thenar.compiler.tables.worstcase import Rounding
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables

from ..checks.ties import first_best
from ..inputs.small_build import small_set

WIDTHS = range(4, 17)


class Width(msgspec.Struct, frozen=True):
    """Integers of `bits` bits beside the ensemble they were made of, on `total` rows that neither has seen.

    scale is in steps per unit of score. worst_steps is the most that any frame's lead over another grasp type loses,
    exactly; worst and bound are that and (inputs + 1) steps in units of score. correct and correct_ensemble count rows
    recognised, kept those that have the ensemble's answer.
    """

    bits: int
    scale: float
    worst_steps: float
    worst: float
    bound: float
    total: int
    correct: int
    correct_ensemble: int
    kept: int

    @property
    def rate(self) -> float:
        """The recognition rate with these integers."""
        return self.correct / self.total


def widths(full: bool) -> list[Width]:
    """Return what each width costs, on a set in which a fifth of the switches read wrongly."""
    rows, rounds = (600, 100) if full else (300, 60)
    trained, unseen = (small_set(seed, rows, switches=24, joints=4, types=8, noise=0.2) for seed in (1, 2))
    stumps, _ = boost(_inputs(trained), trained.labels, 8, rounds=rounds)
    tables, expected = collapse(stumps, 24), winners(stumps.scores(_inputs(unseen)))
    found = []
    for bits in WIDTHS:
        integers = quantise(tables, trained.switches, trained.codes, bits)
        worst = Rounding(tables, integers).worst_of_all().loss
        answers = _answers(integers, unseen)
        found.append(
            Width(
                bits=bits,
                scale=integers.scale,
                worst_steps=float(worst),
                worst=float(worst) / integers.scale,
                bound=(tables.n_inputs + 1) / integers.scale,
                total=rows,
                correct=int(np.count_nonzero(answers == unseen.labels)),
                correct_ensemble=int(np.count_nonzero(expected == unseen.labels)),
                kept=int(np.count_nonzero(answers == expected)),
            )
        )
    return found


def _inputs(grasps: GraspSet) -> NDArray[np.uint16]:
    return np.hstack([grasps.switches, grasps.codes])


def _answers(integers: IntegerTables, grasps: GraspSet) -> NDArray[np.intp]:
    scorer = Scorer(integers)
    frames = zip(grasps.switches, grasps.codes, strict=True)
    return np.array([first_best(scorer.lanes(bits, codes)) for bits, codes in frames])
