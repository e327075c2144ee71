"""Perfectly separable classes, boosted long after they are separated.

When does the loss fall? Friedman's step moves F_k by (K - 1)/K g_k in all classes at once, where g_k is one Newton step
of class k against the rest. The loss is convex, so the step raises it by at most the mean of K steps (K - 1) g_k of a
single class each. With K = 2, and with a shrinkage of 1/(K - 1) or less, these are Newton steps or shorter; and with
the clamp of 3 (up to 4) such a step never overshoots for any rows. So on any data the loss of two classes falls, and
that of more classes with such a shrinkage. With more classes and a shrinkage of 1 it falls if each class has its own
stump that separates it perfectly: scores of its members rise, all others fall. Otherwise the loss of LogitBoost can
rise: two occurring classes among many declared ones are the clearest case, as their difference moves by almost two
Newton steps. There the reported loss is compared with 60 digits instead.
"""

from collections.abc import Iterator

import numpy as np

from thenar.compiler.model.collapse import collapse
from thenar.compiler.trainers.logitboost import boost
from thenar.runtime.model.integers import LIMIT
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.tables import winners

from ..checks.rounds import ROUNDING, RoundState, loss_error, loss_rounding, moments, part_of, rise_rounding
from ..finding import REFERENCE, Finding
from ..inputs.hard_data import HardSet, intervals, separable, words
from ..inputs.hard_tables import largest_sum, listed, rows_of
from ..reference.boosting import mean_loss
from ..reference.numbers import distance
from ..reference.tables import rows_of_frame


def findings(full: bool) -> Iterator[Finding]:
    """Yield the errors of boosting sets of 2 to 33 classes for up to 10,000 rounds, or 300 in the quick run.

    In full, the fewest and the most classes are boosted for 10,000 rounds; what is between, for 2,000.
    """
    classes = (2, 3, 6, 14, 33)
    falling = [separable(k) for k in classes] + [intervals(2), words(2)]
    others = [make(k) for make in (intervals, words) for k in (classes[2:] if full else (14,))]
    between = [separable(k) for k in range(2, 34) if k not in classes] if full else []
    long = {falling[0].name, falling[4].name, others[-1].name}

    def rounds(hard: HardSet) -> int:
        return (10_000 if hard.name in long else 2_000) if full else 300

    runs = [(hard, rounds(hard), hard in falling) for hard in (*falling, *others)]
    yield from _trained(runs + [(hard, 300, True) for hard in between])
    yield _rising()


def _trained(runs: list[tuple[HardSet, int, bool]]) -> Iterator[Finding]:
    """Train sets for the given rounds, and check every round and the result; the loss of some sets must fall.

    Checks at 60 digits come after rounds 1, 2, 4, 8 and so on.
    """
    outside = Finding.of("P, w, w z and outputs finite and in range", "the rules themselves", 0.0, "rounds")
    sums = Finding.of("shares of a row add up to 1", "exact sums", 1.0, "x rounding")
    rises = Finding.of("rise of the loss where it must fall", "convexity", 1.0, "x rounding")
    reported = Finding.of("reported losses that are not the ensemble's", "the ensemble", 0.0, "losses")
    losses = Finding.of("losses, even tiny ones", REFERENCE, 1.0, "x rounding")
    overflow = Finding.of("largest sum of the integer tables, any order", "all rows' extremes", LIMIT, "steps")
    wrong = Finding.of("frames predicted wrongly by ensemble and integers", "their labels", 0.0, "frames")
    for hard, rounds, must_fall in runs:
        stumps, fallen = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds)
        before: RoundState | None = None
        for number, moment in enumerate(moments(hard, stumps)):
            at = f"{hard.name}, round {number}"
            outside.see(float(not _in_range(hard, moment)), at)
            # P = e/S: S, a sum of K numbers, rounds K - 1 times and the quotient once; the sum of P K - 1 times again.
            off = np.abs(moment.shares.sum(axis=0) - 1.0).max()
            sums.see(float(off / (2 * hard.n_classes * ROUNDING)), at)
            reported.see(float(moment.loss != fallen[number]), at)
            if before is not None and must_fall:
                rise = max(0.0, moment.loss - before.loss)
                rises.see(rise / rise_rounding(hard.n_classes, before, moment), at)
            if number & (number - 1) == 0:
                rows, labels = moment.scores.T.tolist(), hard.labels.tolist()
                allowed = loss_error(rows, labels, [1.0] * len(labels))
                losses.see(part_of(moment.loss, mean_loss(rows, labels), allowed), at)
            before = moment
        outside.see(float(not (np.abs(stumps.values) <= 3.0).all()), hard.name)
        for first in (1, 10, stumps.n_rounds):
            integers = quantise(collapse(stumps.first(first), hard.n_switches), hard.bits, hard.codes)
            overflow.see(largest_sum(rows_of(integers)), f"{hard.name}, {first} rounds")
        by_stumps, tables = winners(stumps.scores(hard.X)), listed(integers)
        for label, bits, codes, winner in zip(hard.labels, hard.bits, hard.codes.tolist(), by_stumps, strict=True):
            steps = list(map(sum, zip(*rows_of_frame(*tables, bits, codes), strict=True)))
            wrong.see(float(not label == winner == steps.index(max(steps))), hard.name)
    yield from (outside, sums, rises, reported, losses, overflow, wrong)


def _in_range(hard: HardSet, moment: RoundState) -> bool:
    """Whether 0 <= P <= 1; 0 <= w <= 1/3, the largest of (1 - p) max(p, 1/3); |w z| = |Y - P|; 0 for a settled row.

    1/3, |Y - P| and their product round once each.
    """
    shares, weights, responses = moment.shares, moment.weights, moment.responses
    settled = hard.member & (shares == 1.0)
    return bool(
        np.isfinite(moment.scores).all()
        and ((shares >= 0) & (shares <= 1)).all()
        and ((weights >= 0) & (weights <= (1 + 3 * ROUNDING) / 3)).all()
        and np.array_equal(np.abs(responses), np.where(hard.member, 1.0 - shares, shares))
        and not weights[settled].any()
    )


def _rising() -> Finding:
    """Check that a rise of the loss is real: before and after it the loss is that of the scores."""
    worst = Finding.of("the loss if it may rise (2 of 20 declared classes)", REFERENCE, 1.0, "x rounding")
    X, labels = np.array([[0, 0], [0, 1], [0, 2], [1, 1], [2, 0]]), np.array([0, 1, 0, 0, 1])
    stumps, losses = boost(X, labels, 20, rounds=40)
    scores = [np.zeros((len(X), 20)), *stumps.staged_scores(X)]
    rise = int(np.diff(losses).argmax())
    for number in (rise, rise + 1):
        truth = mean_loss(scores[number].tolist(), labels.tolist())
        worst.see(distance(losses[number], truth) / loss_rounding(20, float(truth)), f"round {number}")
    return worst
