"""Segments of a live stream: the decoder fed at the ticks of its model, with results in the host's time."""

from collections.abc import Sequence

import msgspec

from ..published import NONE, State
from .decoder import Decoder
from .model import SegmentModel

GRACE_US = 500_000
_MOST_SET = 16


class Segment(msgspec.Struct, frozen=True):
    """The segment of a moment, as published in `LiveGrasp`: its state, number, grasp type (that of class `label`, None
    between segments) and beginning.
    """

    state: State = "none"
    number: int = 0
    label: int | None = None
    type: str = NONE
    began_us: int | None = None


class LiveSegments:
    """Feeds a decoder with the newest scores at every tick; uses only integers and times, so a replay gives the same.

    A tick is taken at the first update at or after it. If an update comes late, the ticks before the last due one take
    the scores of the previous update: they were the newest then. While too little can be read, no tick is taken; after
    `GRACE_US` of that, or without an update, the segment is over, and paths start afresh.
    """

    def __init__(self, model: SegmentModel, grasps: Sequence[str], lag_us: int) -> None:
        """Take the names of the model's types, which may be followed by "none"."""
        self.tick_us = model.tick_us
        self._model, self._grasps = model, grasps
        self._lag = lag_us // model.tick_us
        self._decoder = Decoder(model, self._lag)
        self._segments = 0
        self._next_us: int | None = None
        self._last_us = 0
        self._unread = False
        self._scores: tuple[Sequence[int], bool] = (), False
        # Ticks at which the time of ticks was set, and those times: the newest last.
        self._set: list[tuple[int, int]] = []
        self._tick = -1
        self._shown: tuple[State, int, int, int] | None = None
        self.newest = Segment()

    def update(self, now_us: int, scores: Sequence[int] | None, refused: bool = False) -> Segment:
        """Take the newest scores of all classes, and whether the build refuses their frame; None: too little can be
        read. Return the segment at `now_us`.
        """
        since_us = now_us - self._last_us
        if self._next_us is not None and not 0 <= since_us <= GRACE_US:
            self._begin_afresh()
        if scores is None:
            self._unread = True
            return self.newest
        self._last_us = now_us
        if self._next_us is None or (self._unread and now_us > self._next_us):
            self._next_us = now_us
            self._set = [*self._set[-_MOST_SET:], (self._tick + 1, now_us)]
        self._unread = False
        while now_us >= self._next_us:
            last = now_us < self._next_us + self.tick_us
            self._push(*((scores, refused) if last else self._scores))
            self._next_us += self.tick_us
        self._scores = scores, refused
        return self.newest

    def _begin_afresh(self) -> None:
        newest = self.newest
        self._segments = newest.number - (newest.state == "forming")
        self._decoder, self._next_us, self._tick, self._set = Decoder(self._model, self._lag), None, -1, []
        self._shown, self.newest = None, Segment(number=self._segments)

    def _push(self, scores: Sequence[int], refused: bool) -> None:
        found, none = self._decoder.push(scores, refused), self._model.n_types
        self._tick += 1
        number = self._segments + found.segment
        now, newest = (found.state, found.start), (found.newest, found.newest_start)
        if now == newest or found.newest == none:
            state: State = "held" if now == newest else "releasing"
            of, start = now
        else:
            state, number = "forming", number + 1
            of, start = newest
        if (shown := (state, number, of, start)) == self._shown:
            return
        self._shown = shown
        if of == none:
            self.newest = Segment(number=number)
        else:
            self.newest = Segment(state, number, of, self._grasps[of], self._time_us(start))

    def _time_us(self, tick: int) -> int:
        first, time_us = next((each for each in reversed(self._set) if each[0] <= tick), self._set[0])
        return time_us + (tick - first) * self.tick_us
