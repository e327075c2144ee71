"""Hysteresis and dwell: a decision that does not flicker, follows what persists, and rests on whole frames."""

from dataclasses import dataclass

from .standing import Standing


@dataclass(slots=True)
class Decision:
    """The class decided on, out of candidates frame by frame. A frame is whole if none of its inputs is lost.

    - The first candidate after nothing is decided on at once.
    - Another candidate takes over when it has been the candidate, with a lead of at least `lead_steps` over the class
      decided on, in every frame for `dwell_us`.
    - Where for `hold_us` no frame spoke for the class decided on, yet no other could take over, the candidate does.

    That holds among frames of one kind. A decision rests either on whole frames or on frames with lost inputs:

    - One that rests on whole frames is displaced by no frame with lost inputs. Such a frame only ends the dwell of a
      rival, so that a dwell is made of whole frames in a row.
    - After `hold_us` without a whole frame its evidence is too old, and it counts as none: the candidate of the frame
      with lost inputs is decided on at once.
    - One that rests on frames with lost inputs counts as none once a whole frame comes: its candidate is decided on at
      once. So after a whole frame, every decision rests on whole frames.

    So two changes are at least the dwell apart, unless the decision counted as none in between. Times are those of the
    frames (microseconds, never falling): a frame that is seen twice counts once.
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

    def update(self, time_us: int, standing: Standing, *, whole: bool = True) -> int:
        """Return the class decided on, after the frame of `time_us`; `whole`: no input of it is lost."""
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
        """Decide on nothing: too little can be read."""
        self.held = self._rival = None

    def _take(self, candidate: int, time_us: int, whole: bool) -> int:
        self.held, self._whole, self._rival, self._supported_us = candidate, whole, None, time_us
        return candidate
