"""The placement whose worst single lost switch costs least.

A method that looks at rows in which some switches are lost keeps others that can stand in for them. How many should be
lost depends on the rows and on how many switches are kept; so several shares are tried, none among them, and judged on
halves of the trials that were not trained on: of the placements that recognise about as much as the best does, the one
is taken that recognises most where its worst switch is lost.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..additive.logit import fit_logit
from ..samples import Columns, Samples
from ..tables.faults import count_faults
from ..tables.quantise import quantise

# Of the switches, so many are lost in each row that a method looks at; what a placement may cost without a fault.
SHARES = (0.05, 0.1, 0.2)
MOST_LOSS = 0.01
_PENALTY = 1.0


def spread(samples: Samples, share: float) -> Samples:
    """Return the rows with this share of the switches lost in each: what another row has is in their place."""
    n, switches = len(samples.labels), samples.switches.copy()
    random = np.random.default_rng([n, round(1000 * share)])
    for column in switches.T:
        lost, others = random.random(n) < share, random.permutation(n)
        column[lost] = column[others[lost]]
    return replace(samples, switches=switches)


def most_robust(samples: Samples, choose: Callable[[Samples], Columns]) -> Columns:
    """Return the placement of `choose` on these rows, or on rows with lost switches where that is the more robust."""
    plain = choose(samples)
    tried = [plain, *(choose(spread(samples, share))[: len(plain)] for share in SHARES)]
    tried = list(dict.fromkeys(tried))
    if len(tried) == 1 or len(np.unique(samples.trials)) < 2:
        return plain
    counted = [_left(samples, columns) for columns in tried]
    enough = max(correct for correct, _ in counted) - MOST_LOSS * len(np.unique(samples.trials))
    return tried[max(range(len(tried)), key=lambda one: (counted[one][0] >= enough, counted[one][1], -one))]


def _left(samples: Samples, columns: Sequence[int]) -> tuple[int, int]:
    """Return how many trials the switches `columns`, and the joints, recognise in halves that were not trained on; and
    how many where the worst switch is lost.
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
