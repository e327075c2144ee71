"""The placement whose worst single lost switch costs least.

A method trained on rows in which some switches are lost also keeps switches that can stand in for them. The best share
of lost switches depends on the rows and on how many switches are kept. So several shares are tried, including none, and
evaluated by cross-validation on halves of the trials. Of the placements about as accurate as the best, the one with the
highest accuracy under its worst lost switch is taken.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from thenar.runtime.model.quantise import quantise

from ..model.faults import count_faults
from ..samples import Columns, Samples
from ..trainers.logit import fit_logit

# Shares of the switches that are lost in each training row; the accuracy that a placement may cost without a fault.
SHARES = (0.05, 0.1, 0.2)
MOST_LOSS = 0.01
_PENALTY = 1.0


def spread(samples: Samples, share: float) -> Samples:
    """Return the rows with this share of the switches lost in each, replaced by another row's values."""
    n, switches = len(samples.labels), samples.switches.copy()
    random = np.random.default_rng([n, round(1000 * share)])
    for column in switches.T:
        lost, others = random.random(n) < share, random.permutation(n)
        column[lost] = column[others[lost]]
    return replace(samples, switches=switches)


def most_robust(samples: Samples, choose: Callable[[Samples], Columns]) -> Columns:
    """Return the placement of `choose` on these rows, or on rows with lost switches if that is more robust."""
    plain = choose(samples)
    tried = [plain, *(choose(spread(samples, share))[: len(plain)] for share in SHARES)]
    tried = list(dict.fromkeys(tried))
    if len(tried) == 1 or len(np.unique(samples.trials)) < 2:
        return plain
    counted = [_left(samples, columns) for columns in tried]
    enough = max(correct for correct, _ in counted) - MOST_LOSS * len(np.unique(samples.trials))
    return tried[max(range(len(tried)), key=lambda one: (counted[one][0] >= enough, counted[one][1], -one))]


def _left(samples: Samples, columns: Sequence[int]) -> tuple[int, int]:
    """Return how many trials the switches `columns`, and the joints, predict rightly in held-out halves; and how many
    with the worst switch lost.
    """
    _, first, trial = np.unique(samples.trials, return_index=True, return_inverse=True)
    # Every other trial of each class.
    half = np.empty(len(first), np.intp)
    half[np.argsort(samples.labels[first], kind="stable")] = np.arange(len(first)) % 2
    half = half[trial]
    kept, correct, lost = samples.keeping(tuple(columns)), 0, np.zeros(len(columns), np.int64)
    for tested in (0, 1):
        learnt, test = kept.rows(half != tested), kept.rows(half == tested)
        rows = learnt.masked()
        tables = fit_logit(rows.inputs, rows.labels, rows.n_classes, penalty=_PENALTY).score_tables(kept.n_switches)
        integers = quantise(tables, learnt.switches, learnt.codes)
        found = count_faults(integers, test.switches, test.codes, test.labels, test.trials)
        correct += found.correct
        lost += found.lost[: len(columns)]
    return correct, int(lost.min(initial=correct))
