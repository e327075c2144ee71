"""Hysteresis and dwell: a decision that does not flicker, and that follows what persists."""

from dataclasses import dataclass

from .standing import Standing


@dataclass(slots=True)
class Decision:
    """The class decided on, out of candidates frame by frame.

    - The first candidate after nothing is decided on at once.
    - Another candidate takes over when it has been the candidate, with a lead of at least `lead_steps` over the class
      decided on, in every frame for `dwell_us`.
    - Where for `hold_us` no frame spoke for the class decided on, yet no other could take over, the candidate does. So
      no class is held against the frames for longer than that.

    So two changes are at least the dwell apart, unless nothing was decided on in between. Times are those of the frames
    (microseconds, never falling): a frame that is seen twice counts once.
    """

    lead_steps: int
    dwell_us: int
    hold_us: int
    held: int | None = None
    _rival: int | None = None
    _since_us: int = 0
    _supported_us: int = 0

    def update(self, time_us: int, standing: Standing) -> int:
        """Return the class decided on, once the frame of `time_us` has had its say."""
        candidate = standing.candidate
        if self.held is None or candidate == self.held:
            return self._take(candidate, time_us)
        if standing.lead(self.held) < self.lead_steps:
            self._rival = None
        elif candidate != self._rival:
            self._rival, self._since_us = candidate, time_us
        dwelt = self._rival is not None and time_us - self._since_us >= self.dwell_us
        if dwelt or time_us - self._supported_us >= self.hold_us:
            return self._take(candidate, time_us)
        return self.held

    def forget(self) -> None:
        """Decide on nothing: too little can be read."""
        self.held = self._rival = None

    def _take(self, candidate: int, time_us: int) -> int:
        self.held, self._rival, self._supported_us = candidate, None, time_us
        return candidate
