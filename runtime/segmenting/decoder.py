"""The cheapest segmentation of a stream, live or whole: exact Viterbi with explicit shortest durations, O(K) a tick.

Let F_k(t) be the cost of ticks 0 to t in state k, emissions and `stay`. A segment of k that begins at s, entered at
cost enter_k(s) on the cheapest path, costs enter_k(s) - F_k(s - 1) + F_k(t) by tick t. So the best beginning does not
depend on t: b_k(t), the least enter_k(s) - F_k(s - 1) of all s <= t, is one comparison a tick. A segment may end once
it has lasted least_k ticks: a path that may leave k at t costs b_k(t - least_k + 1) + F_k(t), for which the last
least_k values of b_k are kept. The state with the least b_k(t) + F_k(t) is the one in which the cheapest path ends now.

The first segment may be of any length, as the stream may begin within it, and so may the last. Of paths with equal
costs the one wins whose last segment has the lower state, then the one in which it begins earlier, then the segment
before it decides, and so on.
"""

from collections import deque
from collections.abc import Sequence
from functools import lru_cache
from operator import add

import msgspec

from thenar.drivers.errors import SettingError

from ..published import NONE, State
from .model import SegmentModel

_NEVER = 1 << 60
# A pause of a live stream that ends its segment.
GRACE_US = 500_000
_MOST_SET = 16


class Decoded(msgspec.Struct, frozen=True):
    """The known states at a tick.

    state    the state of tick `tick`, which the lag allows to be known now; none before the first, if `tick` < 0
    segment  the number of the grasp segment of this state, or of the last one: it counts changes of `state` to a type,
             from 1; 0 before the first
    start    the tick at which the segment of `state` began, as it is known now
    newest   the state in which the cheapest path ends now
    newest_start  the tick at which its segment began
    """

    state: int
    segment: int
    tick: int
    start: int
    newest: int
    newest_start: int


class _Sources(msgspec.Struct):
    """The possible origins of a segment that begins at a tick, each a state and the tick at which its segment began.

    They are the cheapest type, from which a type begins (never the same type: to go on costs no more); none, from which
    those types begin whose bit is set in `from_none`; and the type from which none begins.
    """

    first: tuple[int, int]
    none: tuple[int, int]
    ending: tuple[int, int]
    from_none: int

    def of(self, state: int) -> tuple[int, int]:
        if state == self.none[0]:
            return self.ending
        return self.none if self.from_none >> state & 1 else self.first


def frame_costs(model: SegmentModel, biased_scores: Sequence[int], refused: bool = False) -> list[int]:
    """Return the costs of a frame for each of the K + 1 states, from its `n_lanes` scores, of any zero."""
    best, shift, extra = max(biased_scores), model.shift, model.refusal
    table = _costs(shift, model.gain, model.most)
    found = [table[best - lane >> shift] for lane in biased_scores]
    if extra is None:
        return found
    return [*(cost + extra for cost in found), 0] if refused else [*found, extra]


@lru_cache
def _costs(shift: int, gain: int, most: int) -> bytes:
    """Return the cost of a frame for a state, for each difference of 16-bit scores, after the shift."""
    return bytes(min(behind * gain >> 8, most) for behind in range(1 << 16 - shift))


class Decoder:
    """Decodes a live stream, with a fixed lag: integers only.

    After each tick it returns the state of `lag_ticks` ticks ago, on the cheapest path to the newest tick. A later tick
    may favour another path: a state once returned is not revised.
    """

    def __init__(self, model: SegmentModel, lag_ticks: int) -> None:
        """Take a lag, in ticks of the model. Raises SettingError if it is negative."""
        if lag_ticks < 0:
            raise SettingError(f"a lag of {lag_ticks} ticks is not possible: use 0 or more")
        K = model.n_types
        self._none, self._tick = K, -1
        self._enter, self._direct, self._leave = model.enter, model.direct, model.leave
        self._least_leave = min(model.leave)
        # The extra cost of none over the cheapest type if a type begins after the latter.
        self._gaps = [direct - enter for enter, direct in zip(model.enter, model.direct, strict=True)]
        self._least_gap, self._largest_gap = min(self._gaps), max(self._gaps)
        # A cost that every state pays at every tick changes no comparison.
        usual = max(model.stay, key=model.stay.count)
        self._stay = [cost - usual for cost in model.stay]
        self._sums, self._best, self._starts = [0] * (K + 1), [0] * (K + 1), [0] * (K + 1)
        # For each of the last ticks, b of all states and the beginnings that belong to it.
        self._past = deque([(self._best, self._starts)] * max(model.least), max(model.least))
        self._least = model.least
        self._costs = (_NEVER, _NEVER, _NEVER)
        self._next = _Sources((0, 0), (K, 0), (0, 0), 0)
        self._sources: deque[_Sources] = deque(maxlen=lag_ticks)
        self._newest = K, 0
        self._model, self._lag = model, lag_ticks
        self._state, self._segment = K, 0

    def push(self, biased_scores: Sequence[int], refused: bool = False) -> Decoded:
        """Take the scores of the next tick, and whether its frame is refused (for models with a refusal)."""
        self._step(frame_costs(self._model, biased_scores, refused))
        tick, newest, begun = self._tick - self._lag, *self._newest
        if tick < 0:
            state, start = self._none, 0
        else:
            state, start = (newest, begun) if begun <= tick else self._back(tick)
        if state != self._state:
            self._segment += state != self._none
            self._state = state
        return Decoded(state, self._segment, tick, start, newest, begun)

    def finish(self) -> list[int]:
        """Return the states of the ticks that the lag still holds back, on the cheapest path to the newest."""
        number, found = min(self._lag, self._tick + 1), list[int]()
        state, start = self._newest
        while len(found) < number:
            found += [state] * (min(self._tick + 1 - start, number) - len(found))
            if len(found) < number:
                state, start = self._sources[start - self._tick - 1].of(state)
        return found[::-1]

    def _step(self, costs: Sequence[int]) -> None:
        """Take the next tick, which costs the states `costs`."""
        self._tick = tick = self._tick + 1
        sums, none, leave, least_leave = self._sums, self._none, self._leave, self._least_leave
        self._best, self._starts = best, starts = self._best[:], self._starts[:]
        past, durations = self._past, self._least
        past.append((best, starts))
        rows = [past[-ticks][0] for ticks in durations[:none]]
        types_costs = map(add, costs, self._stay)
        base, changes, self._next.from_none = self._changes()
        first = ending = within = least = _NEVER
        first_in = ending_in = least_in = 0
        # Types only: the next lines add none.
        for k, change, total, cost, own, row in zip(range(none), changes, sums, types_costs, best, rows, strict=False):
            begun = base + change - total
            total += cost
            sums[k] = total
            if begun < own:
                own = best[k] = begun
                starts[k] = tick
            own += total
            if own < least:
                least, least_in = own, k
            mature = row[k] + total
            # Most types are too expensive for either.
            if mature < within:
                if mature < first:
                    first, first_in = mature, k
                if mature + leave[k] < ending:
                    ending, ending_in = mature + leave[k], k
                within = first if first > ending - least_leave else ending - least_leave
        total = sums[none]
        begun = self._costs[2] - total
        if begun < best[none]:
            best[none], starts[none] = begun, tick
        sums[none] = total = total + costs[none] + self._stay[none]
        self._newest = (none, starts[none]) if best[none] + total < least else (least_in, starts[least_in])
        row, none_ends = past[-durations[none]]
        self._costs = first, row[none] + total, ending
        self._sources.append(self._next)
        first_of, ending_of = ((k, past[-durations[k]][1][k]) for k in (first_in, ending_in))
        self._next = _Sources(first_of, (none, none_ends[none]), ending_of, 0)

    def _changes(self) -> tuple[int, Sequence[int], int]:
        """Return the costs of types that begin now, relative to the first number, and the bits of those that do so
        after none.
        """
        first, none, _ = self._costs
        gap = none - first
        if gap < self._least_gap:
            return none, self._enter, -1
        if gap >= self._largest_gap:
            return first, self._direct, 0
        least = [min(gap + enter, direct) for enter, direct in zip(self._enter, self._direct, strict=True)]
        return first, least, sum(1 << k for k, own in enumerate(self._gaps) if gap < own)

    def _back(self, tick: int) -> tuple[int, int]:
        """Return the state of an earlier tick on the cheapest path to the newest, and when its segment began."""
        state, start = self._newest
        while start > tick:
            state, start = self._sources[start - self._tick - 1].of(state)
        return state, start


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
        self._model, self._none, self._grasps = model, model.n_types, grasps
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
            self._segments = self.newest.number - (self.newest.state == "forming")
            self._decoder, self._next_us, self._tick, self._set = Decoder(self._model, self._lag), None, -1, []
            self._shown, self.newest = None, Segment(number=self._segments)
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

    def _push(self, scores: Sequence[int], refused: bool) -> None:
        found, none = self._decoder.push(scores, refused), self._none
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
            first, time_us = next((each for each in reversed(self._set) if each[0] <= start), self._set[0])
            self.newest = Segment(state, number, of, self._grasps[of], time_us + (start - first) * self.tick_us)
