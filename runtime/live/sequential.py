"""A sequential test: as many frames as a stated error rate takes, no more.

The scores of a frame are log-likelihoods of the grasp types, up to a constant: their softmax is the probability of each
type given the frame, and Bayes' rule divides that by the types' shares in training. The test adds the scores of frames
and decides on the type that leads each of the others by at least ln((K - 1) / error_rate): Armitage's matrix of Wald's
sequential probability ratio tests (P. Armitage, J. R. Stat. Soc. B 12, 1950; A. Wald, Sequential Analysis, 1947). For
two types it is Wald's test. By Ville's inequality a wrong type leads the right one by ln(a) in *any* frame, now or
later, with a probability of at most 1 / a; so, summed over the K - 1 wrong types, whatever the right one is, a test
ends wrong with a probability of at most error_rate. Thresholds and sums are integers: scores in steps, ln(a) rounded
up.

That holds under assumptions, and no longer than they do:
  - one type during a test: evidence older than the longest test is dropped, undecided, and the test begins anew;
  - scores are log-likelihood ratios: the ensemble's probabilities are calibrated, types were recorded equally often;
  - frames are independent, given the type. Successive frames are not: a hand that rests sends nearly the same frame
    again, which is no new evidence. `spacing_us` leaves out frames nearer than that to the last one that counted; take
    the time after which two frames of one grasp are no more alike than frames of two grasps of that type.

Whole frames and frames with lost inputs are never evidence in one test. While an answer or a test that rests on whole
frames is no older than the longest test, frames with lost inputs are left aside; after that they have tests of their
own, whose answers and evidence are dropped at the next whole frame.
"""

import math
from dataclasses import dataclass, field

from .standing import Standing


@dataclass(slots=True)
class SequentialTest:
    """Decides test after test; an answer holds until the next test has one, or `longest_us` have gone.

    After a whole frame, one with no input lost, both the answer and the evidence rest on whole frames.

    error_rate lies between 0 and 1, scale is in steps per unit of score, times are in microseconds.
    """

    classes: int
    scale: float
    error_rate: float
    longest_us: int
    spacing_us: int = 0
    held: int | None = None
    threshold: int = field(init=False)
    _sums: tuple[int, ...] = ()
    _began_us: int = 0
    _counted_us: int | None = None
    _decided_us: int = 0
    _whole: bool = True

    def __post_init__(self) -> None:
        self.threshold = math.ceil(self.scale * math.log((self.classes - 1) / self.error_rate))

    def update(self, time_us: int, standing: Standing, *, whole: bool = True) -> int | None:
        """Return the class of the last test that ended, None if none did lately; `whole`: no input is lost.

        No switch of the frame may have been left unread.
        """
        if self.held is not None and time_us - self._decided_us > self.longest_us:
            self.held = None
        if whole != self._whole and (whole or not self._lasts(time_us)):
            self.forget()
            self._whole = whole
        if whole == self._whole and self._counts(time_us):
            self._counted_us = time_us
            self._add(time_us, standing.lanes)
        return self.held

    def forget(self) -> None:
        """Drop evidence and answer: too little can be read."""
        self.held, self._sums, self._counted_us = None, (), None

    def _lasts(self, time_us: int) -> bool:
        """Return whether there is an answer, or a test under way that is not too old."""
        return self.held is not None or (bool(self._sums) and time_us - self._began_us <= self.longest_us)

    def _counts(self, time_us: int) -> bool:
        return self._counted_us is None or time_us - self._counted_us >= max(self.spacing_us, 1)

    def _add(self, time_us: int, lanes: tuple[int, ...]) -> None:
        if not self._sums or time_us - self._began_us > self.longest_us:
            self._sums, self._began_us = (0,) * self.classes, time_us
        self._sums = tuple(map(int.__add__, self._sums, lanes))
        second, best = sorted(self._sums)[-2:]
        if best - second >= self.threshold:
            self.held, self._decided_us = self._sums.index(best), time_us
            self._sums = ()
