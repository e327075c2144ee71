"""Timelines: the states found in a stream, and its segments with their confidence."""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from .scores import OVERLAPS, score_streams, segments_of


class FoundSegment(msgspec.Struct, frozen=True):
    """A segment: its start and end in seconds, its grasp type, and the mean probability of that type over its ticks.

    subject, session  of the stream
    """

    start_s: float
    end_s: float
    type: str
    confidence: float
    subject: str
    session: str


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """A stream of T ticks and the states found in it.

    start_us, tick_us  the time of the first tick, on the stream's clock, and the duration of a tick
    zero_us            the time from which seconds are counted
    types              names of states 0 to K - 1; state K means that nothing is held
    states, truth      (T,) found, and as recorded; None: unknown
    probabilities      (T,) of the states found
    continued          whether it begins in the middle of a recorded grasp that began in the timeline before
    """

    subject: str
    session: str
    start_us: int
    tick_us: int
    types: tuple[str, ...]
    states: NDArray[np.intp]
    probabilities: NDArray[np.float64]
    truth: NDArray[np.intp] | None = None
    zero_us: int = 0
    continued: bool = False

    @property
    def name(self) -> str:
        """The subject, and the session unless it is the first: "A", or "A 2"."""
        return self.subject if self.session == "1" else f"{self.subject} {self.session}"

    def seconds(self, tick: int) -> float:
        """Return the time of a tick in seconds."""
        return (self.start_us - self.zero_us + tick * self.tick_us) / 1e6

    def segments(self) -> tuple[FoundSegment, ...]:
        """Return the segments in order."""
        return tuple(
            FoundSegment(
                self.seconds(one.start),
                self.seconds(one.end),
                self.types[one.state],
                round(float(self.probabilities[one.start : one.end].mean()), 4),
                self.subject,
                self.session,
            )
            for one in segments_of(self.states, len(self.types))
        )


def probabilities(scores: NDArray[np.integer], states: NDArray[np.intp], scale: float) -> NDArray[np.float64]:
    """Return the softmax probabilities (T,) of the states found, for scores (T, n_lanes) at `scale` steps per unit.

    The probability of nothing held is 0 if the scores do not include it.
    """
    behind = np.exp((scores - scores.max(axis=1, keepdims=True)) / scale)
    shares = behind[np.arange(len(states)), np.minimum(states, scores.shape[1] - 1)] / behind.sum(axis=1)
    return np.asarray(np.where(states < scores.shape[1], shares, 0.0))


def overlap_f1(timelines: Sequence[Timeline]) -> tuple[float, ...] | None:
    """Return F1 at each of OVERLAPS, or None unless the truth of all streams is known and holds a grasp."""
    none = len(timelines[0].types)
    known = [(line.continued, line.truth, line.states, None) for line in timelines if line.truth is not None]
    if len(known) < len(timelines) or not any((truth < none).any() for _, truth, *_ in known):
        return None
    total = score_streams(known, none)
    return tuple(total.f1(place) for place in range(len(OVERLAPS)))
