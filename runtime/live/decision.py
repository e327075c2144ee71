"""The decision, frame after frame: the leader of one frame, hysteresis and dwell, and a sequential test.

The sequential test takes as many frames as the given error rate requires, no more.

The scores of a frame are log-likelihoods of the grasp types, up to a constant: their softmax is the probability of each
type given the frame, and Bayes' rule divides that by the types' shares in training. The test adds the scores of frames
and decides on the type that leads each of the others by at least ln((K - 1) / error_rate): Armitage's matrix of Wald's
sequential probability ratio tests (P. Armitage, J. R. Stat. Soc. B 12, 1950; A. Wald, Sequential Analysis, 1947). For
two types it is Wald's test. By Ville's inequality a wrong type leads the right one by ln(a) in *any* frame, now or
later, with a probability of at most 1 / a; so, summed over the K - 1 wrong types, whatever the right one is, a test
ends wrong with a probability of at most error_rate. Thresholds and sums are integers: scores in steps, ln(a) rounded
up.

That holds only under these assumptions:
  - one type during a test: evidence older than the longest test is dropped, undecided, and the test starts afresh;
  - scores are log-likelihood ratios: the ensemble's probabilities are calibrated, types were recorded equally often;
  - frames are independent, given the type. Successive frames are not: a resting hand sends nearly the same frame
    again, which is no new evidence. `spacing_us` leaves out frames nearer than that to the last one that counted; use
    the time after which two frames of one grasp are no more alike than frames of two grasps of that type.

Whole frames and frames with lost inputs are never evidence in the same test. While a result or a test based on whole
frames is no older than the longest test, frames with lost inputs are ignored; after that they have separate tests,
whose results and evidence are dropped at the next whole frame.
"""

import math

from msgspec import Struct

from ..scores import odds


class Ranking:
    """The K scores of a frame (2^15 too high). A build that refuses frames has K + 1 (`with_none_class`): none is
    the last class.
    """

    __slots__ = ("_margin", "_odds", "biased_scores", "candidate")

    def __init__(self, biased_scores: tuple[int, ...]) -> None:
        self.biased_scores = biased_scores
        self.candidate = biased_scores.index(max(biased_scores))
        self._odds, self._margin = (0.0, 0.0), -1

    @property
    def margin(self) -> int:
        """The candidate's lead over the second best, in steps."""
        if self._margin < 0:
            second, best = sorted(self.biased_scores)[-2:]
            self._margin = best - second
        return self._margin

    def lead(self, held: int) -> int:
        """Return the candidate's lead over class `held`, in steps."""
        return self.biased_scores[self.candidate] - self.biased_scores[held]

    def contradicts(self, held: int, lead: int) -> bool:
        """Return whether the candidate is not `held` and leads it by `lead` steps."""
        return self.candidate != held and self.lead(held) >= lead

    def probability(self, number: int, scale: float) -> float:
        """Return the softmax of class `number`, at `scale` steps per unit."""
        of, total = self._odds
        if of != scale:
            self._odds = scale, (total := odds(self.biased_scores, scale))
        return math.exp(-self.lead(number) / scale) / total

    def with_none_class(self, lead: int) -> "Ranking":
        """Return the same with none, the last class, `lead` steps above the best, or below it if that is negative."""
        return Ranking((*self.biased_scores, max(self.biased_scores) + lead))


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


class SequentialTest(Struct):
    """Decides test after test; a result holds until the next test has one, or `longest_us` have passed.

    After a whole frame, one with no input lost, both the result and the evidence are based on whole frames.

    error_rate is between 0 and 1, scale is in steps per unit of score, times are in microseconds.
    """

    classes: int
    scale: float
    error_rate: float
    longest_us: int
    spacing_us: int = 0
    held: int | None = None
    threshold: int = 0
    _sums: tuple[int, ...] = ()
    _began_us: int = 0
    _counted_us: int | None = None
    _decided_us: int = 0
    _whole: bool = True

    def __post_init__(self) -> None:
        self.threshold = math.ceil(self.scale * math.log((self.classes - 1) / self.error_rate))

    def update(self, time_us: int, standing: Ranking, *, whole: bool = True) -> int | None:
        """Return the class of the last test that ended, None if none did lately; `whole`: no input is lost."""
        if self.held is not None and time_us - self._decided_us > self.longest_us:
            self.held = None
        under_way = bool(self._sums) and time_us - self._began_us <= self.longest_us
        if whole != self._whole and (whole or not (self.held is not None or under_way)):
            self.forget()
            self._whole = whole
        last_us = self._counted_us
        if whole == self._whole and (last_us is None or time_us - last_us >= max(self.spacing_us, 1)):
            self._counted_us = time_us
            self._add(time_us, standing.biased_scores)
        return self.held

    def forget(self) -> None:
        """Drop evidence and result: too little can be read."""
        self.held, self._sums, self._counted_us = None, (), None

    def _add(self, time_us: int, biased_scores: tuple[int, ...]) -> None:
        if not self._sums or time_us - self._began_us > self.longest_us:
            self._sums, self._began_us = (0,) * self.classes, time_us
        self._sums = tuple(map(int.__add__, self._sums, biased_scores))
        second, best = sorted(self._sums)[-2:]
        if best - second >= self.threshold:
            self.held, self._decided_us = self._sums.index(best), time_us
            self._sums = ()
