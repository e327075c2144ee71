"""The agreement of a segmentation with the truth: F1 at overlaps, edit score, onset, end, latency, false preshapes.

F1 is that of Lea, Flynn, Vidal, Reiter and Hager (Temporal convolutional networks for action segmentation and
detection, CVPR 2017): a found segment is right if a true one of its type overlaps it by at least a share of their union
and no earlier one has been counted for it. Nothing held is background, not a segment. The edit score is one minus the
Levenshtein distance of the two sequences of types divided by the length of the longer one.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Labels = NDArray[np.intp]
# Shares of overlap, in percent, from which a found segment counts as right.
OVERLAPS = (10, 25, 50)


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
        every = list(scores)

        def added(name: str) -> int:
            return sum(getattr(one, name) for one in every)

        def joined(name: str) -> tuple[int, ...]:
            return tuple(tick for one in every for tick in getattr(one, name))

        return cls(
            true=added("true"),
            found=added("found"),
            right=tuple(sum(one.right[place] for one in every) for place in range(len(OVERLAPS))),
            recognised=added("recognised"),
            distance=added("distance"),
            longer=added("longer"),
            onsets=joined("onsets"),
            ends=joined("ends"),
            latencies=joined("latencies"),
            false=added("false"),
        )

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
