"""The cheapest segmentation of a stream, tick by tick: exact Viterbi with explicit shortest durations, O(K) a tick.

Let F_k(t) be what ticks 0 to t cost state k, emissions and `stay`. A segment of k that begins at s, before which the
cheapest path costs enter_k(s), costs enter_k(s) - F_k(s - 1) + F_k(t) by tick t. So the best beginning does not depend
on t: b_k(t), the least enter_k(s) - F_k(s - 1) of all s <= t, is one comparison a tick. A segment may end once it has
lasted least_k ticks: a path that may leave k at t costs b_k(t - least_k + 1) + F_k(t), for which the last least_k
values of b_k are kept. The state with the least b_k(t) + F_k(t) is the one in which the cheapest path ends now.

The first segment may be of any length, as the stream may begin within it, and so may the last. Of paths that cost the
same, the one wins whose last segment has the lower state, then the one in which it begins earlier, then the segment
before it decides, and so on.
"""

from collections import deque
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.drivers.errors import SettingError

from ..errors import BuildError
from .model import SegmentModel

_NEVER = 1 << 60


class Decoded(msgspec.Struct, frozen=True):
    """What is known at a tick.

    state    the state of tick `tick`, which the lag allows to be known now; none before the first, where `tick` < 0
    segment  the number of the grasp segment that this state is in, or that was the last: it counts changes of `state`
             to a type, from 1; 0 before the first
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
    """What a segment that begins at a tick could come from, each a state and the tick at which its segment began.

    The cheapest type, from which a type begins (itself never does: to go on costs no more); none, from which those
    types begin whose bit is set in `from_none`; the type from which none begins.
    """

    first: tuple[int, int]
    none: tuple[int, int]
    ending: tuple[int, int]
    from_none: int

    def of(self, state: int) -> tuple[int, int]:
        if state == self.none[0]:
            return self.ending
        return self.none if self.from_none >> state & 1 else self.first


class _Paths:
    """The cheapest paths to the newest tick, and where those of the last `depth` ticks came from; None: of all."""

    def __init__(self, model: SegmentModel, depth: int | None) -> None:
        K = model.n_types
        self._none, self.tick = K, -1
        self._changes = [*zip(model.enter, model.direct, model.leave, strict=True)]
        self._least, self._stay = model.least, model.stay
        self._sums, self._best, self._starts = [0] * (K + 1), [0] * (K + 1), [0] * (K + 1)
        # Of each state, b and the beginning that it is of, of the last least - 1 ticks.
        self._waiting = [deque([(0, 0)] * (least - 1)) for least in model.least]
        self._costs = (_NEVER, _NEVER, _NEVER)
        self._next = _Sources((0, 0), (K, 0), (0, 0), 0)
        self.sources: deque[_Sources] = deque(maxlen=depth)
        self.newest = K, 0

    def step(self, costs: Sequence[int]) -> None:
        """Take the next tick, which costs the states `costs`."""
        self.tick = tick = self.tick + 1
        sums, best, starts, none, sources = self._sums, self._best, self._starts, self._none, self._next
        first_cost, none_cost, ending_cost = self._costs
        from_none = 0
        first = ending = least = _NEVER
        first_of = ending_of = least_of = (0, 0)
        for k, (enter, direct, leave) in enumerate(self._changes):
            total = sums[k]
            begun = first_cost + direct
            if none_cost + enter < begun:
                begun = none_cost + enter
                from_none |= 1 << k
            begun -= total
            if begun < best[k]:
                best[k], starts[k] = begun, tick
            else:
                begun = best[k]
            waiting = self._waiting[k]
            waiting.append((begun, starts[k]))
            mature, start = waiting.popleft()
            sums[k] = total = total + costs[k] + self._stay[k]
            if begun + total < least:
                least, least_of = begun + total, (k, starts[k])
            mature += total
            if mature < first:
                first, first_of = mature, (k, start)
            if mature + leave < ending:
                ending, ending_of = mature + leave, (k, start)
        total = sums[none]
        begun = ending_cost - total
        if begun < best[none]:
            best[none], starts[none] = begun, tick
        waiting = self._waiting[none]
        waiting.append((best[none], starts[none]))
        mature, start = waiting.popleft()
        sums[none] = total = total + costs[none] + self._stay[none]
        self.newest = (none, starts[none]) if best[none] + total < least else least_of
        sources.from_none = from_none
        self.sources.append(sources)
        self._costs = first, mature + total, ending
        self._next = _Sources(first_of, (none, start), ending_of, 0)

    def back(self, tick: int) -> tuple[int, int]:
        """Return the state of an earlier tick on the cheapest path to the newest, and when its segment began."""
        state, start = self.newest
        while start > tick:
            state, start = self.sources[start - self.tick - 1].of(state)
        return state, start

    def states(self, number: int) -> list[int]:
        """Return the states of the last `number` ticks on the cheapest path to the newest."""
        found: list[int] = []
        state, start = self.newest
        while len(found) < number:
            found += [state] * (min(self.tick + 1 - start, number) - len(found))
            if len(found) < number:
                state, start = self.sources[start - self.tick - 1].of(state)
        return found[::-1]


class Decoder:
    """Decodes a live stream, with a fixed lag: integers only.

    After each tick it says what state held `lag_ticks` ticks ago, on the cheapest path to the newest tick. A later tick
    may favour another path: what was said is not taken back.
    """

    __slots__ = ("_lag", "_model", "_paths", "_segment", "_state")

    def __init__(self, model: SegmentModel, lag_ticks: int) -> None:
        """Take a lag, in ticks of the model. Raises SettingError if it is negative."""
        if lag_ticks < 0:
            raise SettingError(f"a lag of {lag_ticks} ticks: it is 0 or more")
        self._model, self._lag, self._paths = model, lag_ticks, _Paths(model, lag_ticks)
        self._state, self._segment = model.n_types, 0

    def push(self, lanes: Sequence[int], refused: bool = False) -> Decoded:
        """Take the scores of the next tick, and whether its frame is refused (of models with a refusal)."""
        paths = self._paths
        paths.step(self._model.costs(lanes, refused))
        tick = paths.tick - self._lag
        state, start = paths.back(tick) if tick >= 0 else (self._model.n_types, 0)
        if state != self._state:
            self._segment += state != self._model.n_types
            self._state = state
        return Decoded(state, self._segment, tick, start, *paths.newest)

    def finish(self) -> list[int]:
        """Return the states of the ticks that the lag still holds back, on the cheapest path to the newest."""
        return self._paths.states(min(self._lag, self._paths.tick + 1))


def emissions(scores: ArrayLike, model: SegmentModel, refused: ArrayLike | None = None) -> NDArray[np.int64]:
    """Return what frames cost the states, (T, K + 1), as `SegmentModel.costs` does frame by frame.

    Parameters
    ----------
    scores : array of int, shape (T, n_lanes)
        The frames' scores.
    model : SegmentModel
        Its `shift`, `gain`, `most` and `refusal` are used.
    refused : array of bool, shape (T,), optional
        Frames that the build's rejection refuses; of a model with a refusal.

    Raises
    ------
    BuildError
        If the scores are of another number of classes.
    """
    lanes = np.asarray(scores, np.int64)
    if lanes.ndim != 2 or lanes.shape[1] != model.n_lanes:
        raise BuildError(f"scores of shape {lanes.shape}, the segment model takes {model.n_lanes} a frame")
    behind = lanes.max(axis=1, initial=np.iinfo(np.int64).min, keepdims=True) - lanes
    found: NDArray[np.int64] = np.minimum((behind >> model.shift) * model.gain >> 8, model.most)
    if model.refusal is None:
        return found
    no = np.zeros(len(lanes), bool) if refused is None else np.asarray(refused, bool)
    more = np.where(no, model.refusal, 0)[:, np.newaxis]
    return np.hstack([found + more, model.refusal - more])


def decode(model: SegmentModel, emissions: ArrayLike) -> NDArray[np.intp]:
    """Return the states (T,) of the cheapest segmentation of a whole stream, of the emissions (T, K + 1)."""
    costs = np.asarray(emissions, np.int64).reshape(-1, model.n_types + 1)
    paths = _Paths(model, None)
    for row in costs.tolist():
        paths.step(row)
    return np.array(paths.states(len(costs)), np.intp)
