"""The decision, frame after frame: the leader of one frame, hysteresis and dwell."""

from msgspec import Struct

from ..scores import softmax


class Ranking:
    """The K scores of a frame (2^15 too high), K + 1 if the build refuses frames (`Scorer.with_none`); the best class,
    and its lead over the second best, in steps.
    """

    __slots__ = ("_shares", "biased_scores", "candidate", "margin")

    def __init__(self, biased_scores: tuple[int, ...]) -> None:
        second, best = sorted(biased_scores)[-2:]
        self.biased_scores = biased_scores
        self.candidate, self.margin = biased_scores.index(best), best - second
        self._shares = 0.0, list[float]()

    def lead(self, held: int) -> int:
        """Return the candidate's lead over class `held`, in steps."""
        return self.biased_scores[self.candidate] - self.biased_scores[held]

    def contradicts(self, held: int, lead: int) -> bool:
        """Return whether the candidate is not `held` and leads it by `lead` steps."""
        return self.candidate != held and self.lead(held) >= lead

    def probability(self, number: int, scale: float) -> float:
        """Return the softmax of class `number`, at `scale` steps per unit."""
        if self._shares[0] != scale:
            self._shares = scale, softmax(self.biased_scores, scale)
        return self._shares[1][number]


class Decision(Struct):
    """The decided class, from candidates frame by frame. A frame is whole if none of its inputs is lost.

    - The first candidate, with no class decided, is decided on at once.
    - Another candidate takes over when it has been the candidate, with a lead of at least `lead_steps` over the decided
      class, in every frame for `dwell_us`.
    - If for `hold_us` no frame favoured the decided class, yet no other could take over, the candidate does.

    This applies to frames of one kind. A decision is based either on whole frames or on frames with lost inputs:

    - One based on whole frames is displaced by no frame with lost inputs. Such a frame only ends the dwell of another
      candidate, so that a dwell consists of consecutive whole frames.
    - After `hold_us` without a whole frame its evidence is too old, and it counts as none: the candidate of the frame
      with lost inputs is decided on at once.
    - One based on frames with lost inputs counts as none once a whole frame comes: its candidate is decided on at once.
      So after a whole frame, every decision is based on whole frames.

    So two changes are at least the dwell time apart, unless the decision counted as none in between. Times are those
    of the frames (microseconds, never falling): a frame that is seen twice counts once.
    """

    lead_steps: int
    dwell_us: int
    hold_us: int
    held: int | None = None
    _whole: bool = False
    _whole_us: int = 0
    _rival: int | None = None
    _since_us: int = 0
    _supported_us: int = 0

    def update(self, time_us: int, standing: Ranking, *, whole: bool = True) -> int:
        """Return the decided class after the frame of `time_us`; `whole`: no input of it is lost."""
        if whole:
            self._whole_us = time_us
        elif self.held is not None and self._whole and time_us - self._whole_us < self.hold_us:
            self._rival = None
            return self.held
        candidate = standing.candidate
        if self.held is None or candidate == self.held or whole != self._whole:
            return self._take(candidate, time_us, whole)
        if standing.lead(self.held) < self.lead_steps:
            self._rival = None
        elif candidate != self._rival:
            self._rival, self._since_us = candidate, time_us
        dwelt = self._rival is not None and time_us - self._since_us >= self.dwell_us
        if dwelt or time_us - self._supported_us >= self.hold_us:
            return self._take(candidate, time_us, whole)
        return self.held

    def forget(self) -> None:
        """Drop the decision: too little can be read."""
        self.held = self._rival = None

    def _take(self, candidate: int, time_us: int, whole: bool) -> int:
        self.held, self._whole, self._rival, self._supported_us = candidate, whole, None, time_us
        return candidate
