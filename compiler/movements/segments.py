"""Segments: the agreement of found ones with the truth, and a build's `SegmentModel`, learnt from the streams of a set.

F1 is that of Lea, Flynn, Vidal, Reiter and Hager (Temporal convolutional networks for action segmentation and
detection, CVPR 2017): a found segment is right if a true one of its type overlaps it by at least a share of their union
and no earlier one has been counted for it. Nothing held is background, not a segment. The edit score is one minus the
Levenshtein distance of the two sequences of types divided by the length of the longer one.

Learning counts durations and changes on the true segments: how long each state lasts (a shortest duration, and a
geometric law beyond it), and which state follows which. It then searches, on scores of rows that were not used to train
the tables: the weight of a frame (the temperature of its emission), the extra cost of a tick of nothing held, and the
extra cost of a change. Few movements say little about the best values. Of all candidates whose F1@50, decoded live, is
within one standard error of the highest, it chooses the one with the fewest false announcements; ties by smaller median
onset error, then by F1@50.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from itertools import chain, product
from statistics import median
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.runtime.errors import BuildError
from thenar.runtime.segmenting.decoder import Decoder
from thenar.runtime.segmenting.model import STEPS, SegmentModel, gain_of

from .streams import Stream

Labels = NDArray[np.intp]
# Shares of overlap, in percent, from which a found segment counts as right.
OVERLAPS = (10, 25, 50)
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


class Span(NamedTuple):
    """Ticks `start` to `end`, exclusive, in one state."""

    start: int
    end: int
    state: int


def segments_of(states: ArrayLike, none: int) -> list[Span]:
    """Return the segments of types in `states` (T,): runs of one state other than `none`."""
    given = np.asarray(states, np.intp)
    starts = np.flatnonzero(np.diff(given, prepend=-1))
    ends = np.append(starts[1:], len(given))
    runs = zip(starts.tolist(), ends.tolist(), given[starts].tolist(), strict=True)
    return [Span(*run) for run in runs if run[2] != none]


@dataclass(frozen=True, slots=True)
class SegmentScore:
    """Counts over one stream, or sums over several.

    true, found   segments; right: those found correctly at each of OVERLAPS; recognised: true ones with their type in
                  most of their ticks
    distance      the Levenshtein distance and the length of the longer sequence, summed over streams
    onsets, ends  the delays in ticks of the start and end of segments that are right at the smallest overlap
    latencies     ticks from the start of a true segment until its type is announced, where it is
    false         announced segments that start while nothing is held
    """

    true: int = 0
    found: int = 0
    right: tuple[int, ...] = (0,) * len(OVERLAPS)
    recognised: int = 0
    distance: int = 0
    longer: int = 0
    onsets: tuple[int, ...] = ()
    ends: tuple[int, ...] = ()
    latencies: tuple[int, ...] = ()
    false: int = 0

    @classmethod
    def total(cls, scores: Iterable[Self]) -> Self:
        """Return the sum of several scores."""
        parts, totals = list(scores), dict[str, Any]()
        for field in fields(cls):
            values = [getattr(part, field.name) for part in parts]
            totals[field.name] = sum(values) if field.default == 0 else tuple(chain(*values))
        # These are no lists of ticks: they are added number by number.
        totals["right"] = tuple(sum(part.right[place] for part in parts) for place in range(len(OVERLAPS)))
        return cls(**totals)

    def f1(self, place: int) -> float:
        """Return F1 at an overlap, by its index in OVERLAPS; 1 if there are no segments and none was found."""
        counted = self.true + self.found
        return 2 * self.right[place] / counted if counted else 1.0

    @property
    def edit(self) -> float:
        """The edit score; 1 if there are no segments and none was found."""
        return 1 - self.distance / self.longer if self.longer else 1.0

    @property
    def recognition(self) -> float:
        """The share of true segments with their type in most of their ticks."""
        return self.recognised / self.true if self.true else 1.0

    @property
    def onset(self) -> float:
        """The median absolute onset error in ticks; infinite without segments."""
        return median(map(abs, self.onsets)) if self.onsets else float("inf")


def score(truth: ArrayLike, found: ArrayLike, none: int, announced: ArrayLike | None = None) -> SegmentScore:
    """SegmentScore the states found in a stream.

    Parameters
    ----------
    truth, found : array of int, shape (T,)
        The state of each tick.
    none : int
        The state in which nothing is held.
    announced : array of int, shape (T,), optional
        The state published at each tick, which may lag behind. None: nothing is published.

    Returns
    -------
    SegmentScore
        The counts.
    """
    right, given = np.asarray(truth, np.intp), np.asarray(found, np.intp)
    true, segments = segments_of(right, none), segments_of(given, none)
    hits, pairs = _matched(true, segments)
    latencies, false = ([], 0) if announced is None else _announced(true, right, np.asarray(announced, np.intp), none)
    return SegmentScore(
        true=len(true),
        found=len(segments),
        right=hits,
        recognised=sum(2 * int((given[one.start : one.end] == one.state).sum()) > one.end - one.start for one in true),
        distance=levenshtein([one.state for one in true], [one.state for one in segments]),
        longer=max(len(true), len(segments)),
        onsets=tuple(segments[at].start - one.start for one, at in pairs),
        ends=tuple(segments[at].end - one.end for one, at in pairs),
        latencies=tuple(latencies),
        false=false,
    )


def score_streams(streams: Iterable[tuple[bool, Labels, Labels, Labels | None]], none: int) -> SegmentScore:
    """SegmentScore streams, in order: whether one continues a grasp of the one before, then the arguments of `score`.

    A grasp that a pause divides is one true segment all the same, whatever was found on either side.
    """
    joined: list[list[Labels]] = []
    for continued, truth, found, announced in streams:
        arrays = [truth, found] if announced is None else [truth, found, announced]
        if continued and joined:
            # A tick in which nothing is found stands for the pause.
            pause = (int(truth[0]), none, none)
            parts = zip(joined.pop(), pause, arrays, strict=False)
            arrays = [np.concatenate([one, [state], more]) for one, state, more in parts]
        joined.append(arrays)
    return SegmentScore.total(score(truth, found, none, *rest) for truth, found, *rest in joined)


def _matched(true: list[Span], found: list[Span]) -> tuple[tuple[int, ...], list[tuple[Span, int]]]:
    """Return how many of `found` are right at each of OVERLAPS, and the matches at the smallest overlap.

    A match is the index of a true segment and the segment found for it.
    """
    counts, pairs, first = [0] * len(OVERLAPS), list[tuple[Span, int]](), 0
    matched: list[set[int]] = [set() for _ in OVERLAPS]
    for place, one in enumerate(found):
        while first < len(true) and true[first].end <= one.start:
            first += 1
        # Between equal overlaps, take the earlier.
        best, common, union, at = -1, 0, 1, first
        while at < len(true) and true[at].start < one.end:
            other = true[at]
            shared = min(one.end, other.end) - max(one.start, other.start)
            joined = max(one.end, other.end) - min(one.start, other.start)
            if other.state == one.state and shared * union > common * joined:
                best, common, union = at, shared, joined
            at += 1
        for number, least in enumerate(OVERLAPS):
            if best >= 0 and 100 * common >= least * union and best not in matched[number]:
                matched[number].add(best)
                counts[number] += 1
                if not number:
                    pairs.append((true[best], place))
    return tuple(counts), pairs


def _announced(true: list[Span], truth: Labels, announced: Labels, none: int) -> tuple[list[int], int]:
    """Return the latencies in ticks of true segments announced before the next one, and the number of false
    announcements.

    A segment that is announced too early has a negative latency; a false one starts while nothing is held.
    """
    latencies = []
    for place, one in enumerate(true):
        before = true[place - 1].end if place else 0
        after = true[place + 1].start if place + 1 < len(true) else len(truth)
        late = np.flatnonzero(announced[one.start : after] == one.state)
        if len(late) and late[0]:
            latencies.append(int(late[0]))
        elif len(late):
            other = np.flatnonzero(announced[before : one.start] != one.state)
            latencies.append((before + int(other[-1]) + 1 if len(other) else before) - one.start)
    return latencies, sum(bool(truth[span.start] == none) for span in segments_of(announced, none))


def levenshtein(one: list[int], other: list[int]) -> int:
    """Return the smallest number of insertions, deletions and replacements between two sequences."""
    columns, numbers = np.array(other, np.intp), np.arange(len(other) + 1)
    row = numbers.copy()
    for done, state in enumerate(one, 1):
        cheapest = np.minimum(row[1:] + 1, row[:-1] + (columns != state))
        row = np.minimum.accumulate(np.concatenate([[done], cheapest]) - numbers) + numbers
    return int(row[-1])


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
    """Return the states (T,) that a live decoder reports for scores (T, n_lanes), `lag_ticks` after each tick.

    With a lag of T they are those of the cheapest segmentation of the whole stream. Raises BuildError for scores of
    other classes.
    """
    if biased_scores.ndim != 2 or biased_scores.shape[1] != model.n_lanes:
        raise BuildError(
            f"scores have shape {biased_scores.shape}, but the segment model takes {model.n_lanes} a frame"
        )
    decoder = Decoder(model, lag_ticks)
    no = np.zeros(len(biased_scores), bool) if refused is None else refused
    ticks = zip(biased_scores.tolist(), no.tolist(), strict=True)
    states = [decoder.push(scores, rejected).state for scores, rejected in ticks][lag_ticks:]
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
