"""Learn a build's `SegmentModel` from the streams of a set: count durations and changes, and search for the costs.

Counted on the true segments: how long each state lasts (a shortest duration, and a geometric law beyond it), and which
state follows which. Searched, on scores of rows that were not used to train the tables: the weight of a frame (the
temperature of its emission), the extra cost of a tick of nothing held, and the extra cost of a change. Few movements
say little about the best values. Of all candidates whose F1@50, decoded live, is within one standard error of the
highest, choose the one with the fewest false announcements; ties by smaller median onset error, then by F1@50.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.segmenting.decoder import Decoder, emissions
from thenar.runtime.segmenting.model import STEPS, SegmentModel, gain_of

from .scores import OVERLAPS, SegmentScore, score
from .streams import Stream

Labels = NDArray[np.intp]

LAG_TICKS = 15  # delay of the live decision: 150 ms
_AT_HALF = len(OVERLAPS) - 1
_LARGEST = 4095
_SCALE = 256.0  # steps per unit of the scores in the search
_MOST_NATS = 6.0  # the most evidence of a frame, before its temperature
# The shortest duration is half of the shortest observed one, and at most this many ticks.
_SHORTEST, _LONGEST_LEAST = 0.5, 30
# Temperatures; nats of a score by which nothing held must lead; additional nats that a change costs.
TEMPERATURES, LEADS, CHANGES = (0.35, 0.2, 0.1, 0.8), (0.0, 1.0, -1.0, 2.0, -2.0), (2.0, 5.0)
# Ticks decoded per candidate model: the first ones of longer streams.
_TRIED_TICKS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class Counts:
    """Counts over the true segments of streams, except segments cut off by a stream.

    Durations in ticks by state, and how often a state follows another, (K + 1, K + 1), with nothing held last.
    """

    durations: tuple[tuple[int, ...], ...]
    changes: NDArray[np.intp]

    @classmethod
    def of(cls, truths: Iterable[Labels], n_types: int) -> "Counts":
        """Count in the states (T,) of each stream."""
        durations: list[list[int]] = [[] for _ in range(n_types + 1)]
        changes = np.zeros((n_types + 1, n_types + 1), np.intp)
        for truth in truths:
            starts = np.flatnonzero(np.diff(truth, prepend=-1))
            states = truth[starts]
            np.add.at(changes, (states[:-1], states[1:]), 1)
            for state, ticks in zip(states[1:-1].tolist(), np.diff(starts)[1:].tolist(), strict=True):
                durations[state].append(ticks)
        return cls(tuple(map(tuple, durations)), changes)


def learnt(
    streams: Sequence[Stream],
    labels: Labels,
    scores: NDArray[np.float64] | None,
    n_types: int,
    scale: float,
    tick_us: int,
) -> SegmentModel:
    """Learn the model of a build that detects nothing held.

    Parameters
    ----------
    streams : sequence of Stream
        The rows in time.
    labels : array of int, shape (n,)
        The class of each row, with nothing held as the last class.
    scores : array of float, shape (n, K + 1), or None
        The scores of each row, from tables that were not trained on rows of its movement (or subject). None: the costs
        are not searched, and the first candidates are used.
    n_types : int
        The number of grasp types, K.
    scale : float
        Steps per unit of the build's integer tables.
    tick_us : int
        The duration of a tick.

    Returns
    -------
    SegmentModel
        The same for the same arguments on any machine.
    """
    counts = Counts.of((labels[stream.rows] for stream in streams), n_types)
    chosen = TEMPERATURES[0], LEADS[0], CHANGES[0]
    if scores is not None:
        share = max(1, _TRIED_TICKS // len(streams))
        biased_scores = np.rint(scores * _SCALE).astype(np.int64)
        tests = [(biased_scores[rows], labels[rows]) for rows in (stream.rows[:share] for stream in streams)]
        chosen = _best(counts, tests, tick_us)
    return model_of(counts, *chosen, scale, tick_us)


def _best(
    counts: Counts, tests: Sequence[tuple[NDArray[np.int64], Labels]], tick_us: int
) -> tuple[float, float, float]:
    """Return the temperature, lead and change cost that decode scores (T, K + 1) best to their states (T,)."""
    none = len(counts.durations) - 1

    def score_of(costs: tuple[float, float, float]) -> SegmentScore:
        model = model_of(counts, *costs, _SCALE, tick_us)
        decoded = ((truth, live_states(model, biased_scores, LAG_TICKS)) for biased_scores, truth in tests)
        return SegmentScore.total(
            score(truth, live, none, announced_live(live, none, LAG_TICKS)) for truth, live in decoded
        )

    def best(candidates: Sequence[tuple[float, float, float]]) -> tuple[float, float, float]:
        scores = {costs: score_of(costs) for costs in candidates}
        highest = max(one.f1(_AT_HALF) for one in scores.values())
        error = math.sqrt(highest * (1 - highest) / max(scores[candidates[0]].true, 1))
        near = [costs for costs, one in scores.items() if one.f1(_AT_HALF) >= highest - error]
        return min(near, key=lambda costs: (scores[costs].false, scores[costs].onset, -scores[costs].f1(_AT_HALF)))

    first = best(list(product(TEMPERATURES, LEADS, CHANGES[:1])))
    return best([(*first[:2], change) for change in CHANGES])


def model_of(
    counts: Counts, temperature: float, lead: float, change: float, scale: float, tick_us: int
) -> SegmentModel:
    """Return the model of these counts.

    temperature scales the emissions, `lead` is the nats by which nothing held must lead in a frame, and `change` the
    additional nats that a change costs.
    """
    K = len(counts.durations) - 1
    shift, gain = gain_of(scale, temperature)
    most = min(254, max(1, round(STEPS * _MOST_NATS * temperature)), 255 * gain >> 8)
    pooled = [ticks for durations in counts.durations[:K] for ticks in durations]
    least = [_shortest(pooled)] * K + [_shortest(counts.durations[K])]
    stay = [_staying(pooled, least[0])] * K + [_staying(counts.durations[K], least[K])]
    bias = round(STEPS * temperature * lead)
    stay = [cost + max(-bias, 0) for cost in stay[:K]] + [stay[K] + max(bias, 0)]
    extra = STEPS * change
    into = counts.changes[K, :K] + 0.5
    enter = [_cost(share / into.sum(), extra) for share in into]
    # Equal for all types: few changes of each are observed, and a small processor saves a lookup.
    others, ends = int(counts.changes[:K, :K].sum()) + 0.5, int(counts.changes[:K, K].sum()) + 0.5
    leave, other = ends / (others + ends), others / (others + ends)
    more = _cost(other, 0)
    return SegmentModel(
        shift=shift,
        gain=gain,
        most=most,
        least=tuple(least),
        stay=tuple(stay),
        enter=tuple(enter),
        leave=(_cost(leave, extra),) * K,
        direct=tuple(min(cost + more, _LARGEST) for cost in enter),
        tick_us=tick_us,
    )


def live_states(
    model: SegmentModel, biased_scores: NDArray[np.integer], lag_ticks: int, refused: NDArray[np.bool_] | None = None
) -> Labels:
    """Return the states (T,) that a live decoder reports for scores (T, n_lanes), `lag_ticks` after each tick."""
    decoder = Decoder(model, lag_ticks)
    states = [decoder.take(costs).state for costs in emissions(biased_scores, model, refused).tolist()][lag_ticks:]
    return np.array(states + decoder.finish(), np.intp)


def announced_live(states: Labels, none: int, lag_ticks: int) -> Labels:
    """Return the state (T,) published at each tick, if it is that of `lag_ticks` earlier."""
    return np.concatenate([np.full(lag_ticks, none, np.intp), states])[: len(states)]


def _shortest(durations: Sequence[int]) -> int:
    """Return the shortest duration to allow given observed ones, ignoring the shortest twentieth."""
    if not durations:
        return 1
    seen = sorted(durations)[len(durations) // 20]
    return min(max(1, int(_SHORTEST * seen)), _LONGEST_LEAST)


def _staying(durations: Sequence[int], least: int) -> int:
    """Return the cost of a tick with which durations beyond the shortest are geometric with the observed mean."""
    if not durations:
        return 0
    mean = sum(durations) / len(durations) - least
    return round(-STEPS * math.log(mean / (mean + 1))) if mean > 0 else STEPS


def _cost(probability: float, extra: float) -> int:
    return min(round(-STEPS * math.log(probability) + extra), _LARGEST)
